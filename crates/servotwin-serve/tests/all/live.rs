//! The server as a viewer meets it: who may come in, what it sends, what it takes, and what a bad viewer cannot do.

use crate::viewer::{
    FAULT, ask, event_of, frame, get, get_bytes, inject_request, join, live, messages, own, save,
    served, served_from, wait_for,
};
use serde_json::{Value, json};
use servotwin::live::closed_loop::{ClosedLoop, ClosedLoopFlight};
use servotwin_model::program::FaultAt;
use servotwin_serve::signals::{ShownSample, Signals};
use servotwin_serve::{Access, Live};
use std::io::{ErrorKind, Read, Write};
use std::net::TcpStream;
use std::sync::OnceLock;
use std::time::Duration;
use tungstenite::Message;

#[test]
fn the_page_and_everything_beside_it_are_in_the_server() {
    served(|address| {
        for path in
            ["/", "/page.js", "/player.js", "/page.css", "/player.css", "/uplot.js", "/uplot.css"]
        {
            let (status, body) = get(address, path, &address.to_string(), "");
            assert!(status == 200 && body.len() > 1000, "{path}: {status}");
            let elsewhere = body.matches("http://").count() + body.matches("https://").count();
            // The one name of a namespace, and the home of the charts in their license line.
            assert!(elsewhere <= 1, "{path} asks elsewhere");
        }
        assert_eq!(get(address, "/nothing", &address.to_string(), "").0, 404);
        let about = own(address, "/about");
        let faults = about["components"].as_array().unwrap().iter();
        let faults: Vec<&Value> =
            faults.flat_map(|one| one["faults"].as_array().unwrap()).collect();
        assert!(faults.iter().any(|fault| fault["id"] == FAULT));
        // Each component is in the drawing, where the page finds it by its name.
        let drawing = about["schematic"].as_str().unwrap();
        for component in about["components"].as_array().unwrap() {
            let id = component["id"].as_str().unwrap();
            assert!(drawing.contains(&format!("data-component=\"{id}\"")), "{id} is not drawn");
        }
    });
}

#[test]
fn other_pages_and_other_names_are_refused() {
    served(|address| {
        let own_host = address.to_string();
        let evil = "Origin: http://evil.example\r\n";
        let longer = format!("{own_host}.evil.example");
        for (path, host, more) in [
            ("/about", own_host.as_str(), evil),
            ("/about", "evil.example", ""),
            ("/", "evil.example", ""),
            ("/events", "127.0.0.1.evil.example", ""),
            ("/", &longer, ""),
        ] {
            assert_eq!(get(address, path, host, more).0, 403, "{path} {host} {more}");
        }
        let upgrade = "Upgrade: websocket\r\nSec-WebSocket-Version: 13\r\n\
                       Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n";
        let with_upgrade = format!("{evil}{upgrade}").replace("Connection: close\r\n", "");
        assert_ne!(get(address, "/live", &own_host, &with_upgrade).0, 101);
        assert_eq!(own(address, "/counts")["refused_visits"], 6);
        let port = address.port();
        assert_eq!(get(address, "/about", &format!("localhost:{port}"), "").0, 200);
    });
}

#[test]
fn another_page_may_lead_here_and_ask_for_nothing() {
    served(|address| {
        let host = address.to_string();
        let from = |site: &str| format!("Sec-Fetch-Site: {site}\r\n");
        for (path, more, status) in [
            ("/page.html", from("cross-site"), 403),
            ("/session", from("same-site"), 403),
            ("/about", from("cross-site"), 403),
            ("/about", from("same-origin"), 200),
            ("/about", from("none"), 200),
            ("/", from("cross-site"), 200),
            // A proxy that ends TLS changes the scheme alone.
            ("/about", format!("Origin: https://{host}\r\n"), 200),
            ("/about", "Origin: https://evil.example\r\n".into(), 403),
            ("/about", "Origin: null\r\n".into(), 403),
        ] {
            assert_eq!(get_bytes(address, path, &host, &more).0, status, "{path} {more}");
        }
    });
}

#[test]
fn more_connections_than_there_is_room_for_are_closed_at_once() {
    served(|address| {
        let mut waiting: Vec<_> = (0..200).map(|_| TcpStream::connect(address).unwrap()).collect();
        let mut byte = [0];
        let last = waiting.last_mut().unwrap();
        last.set_read_timeout(Some(Duration::from_secs(5))).unwrap();
        let closed = last.read(&mut byte);
        assert!(
            matches!(&closed, Ok(0))
                || closed.is_err_and(|e| e.kind() == ErrorKind::ConnectionReset)
        );
        waiting[0].set_read_timeout(Some(Duration::from_millis(50))).unwrap();
        assert_eq!(waiting[0].read(&mut byte).unwrap_err().kind(), ErrorKind::WouldBlock);
        drop(waiting);
        // The server sees each of them leave.
        std::thread::sleep(Duration::from_millis(300));
        assert_eq!(own(address, "/about")["kind"], "flight");
    });
}

#[test]
#[ignore = "slow: ./check --all"]
fn a_connection_that_asks_for_nothing_is_closed_after_ten_seconds() {
    served(|address| {
        let mut half = TcpStream::connect(address).unwrap();
        half.write_all(b"GET /about HTTP/1.1\r\n").unwrap();
        half.set_read_timeout(Some(Duration::from_secs(20))).unwrap();
        let begin = std::time::Instant::now();
        let mut answer = vec![];
        half.read_to_end(&mut answer).unwrap();
        assert!((8..15).contains(&begin.elapsed().as_secs()), "{:?}", begin.elapsed());
    });
}

#[test]
fn beyond_this_machine_a_token_is_needed() {
    let access = Access::to(([0, 0, 0, 0], 0).into()).unwrap();
    let other = Access::to(([0, 0, 0, 0], 0).into()).unwrap();
    assert_eq!(access.token.as_ref().map(String::len), Some(32));
    assert_ne!(access.token, other.token);
    assert_eq!(Access::to(([127, 0, 0, 1], 0).into()).unwrap().token, None);
}

#[test]
fn a_fault_is_injected_found_and_answered_as_the_server_logs_it() {
    served(|address| {
        let mut viewer = join(address);
        wait_for(&mut viewer, |said| (said["state"]["finding"] == "healthy").then_some(()));
        ask(&mut viewer, &inject_request());
        let injected = wait_for(&mut viewer, |said| event_of(said, "inject"));
        let action = wait_for(&mut viewer, |said| event_of(said, "action"));
        assert_eq!(
            (&action["actuator"], &action["action"]),
            (&json!("actuator_1"), &json!("shut_down"))
        );
        let time = |event: &Value| event["time_s"].as_f64().unwrap();
        let latency_s = action["after_s"].as_f64().unwrap();
        assert!((time(&action) - time(&injected) - latency_s).abs() < 0.05, "{action} {injected}");
        let state = wait_for(&mut viewer, |said| said.get("state").cloned());
        assert_eq!(state["injected"][0]["fault"], FAULT);
        assert_eq!(state["actions"][0]["action"], "shut_down");
        let events = own(address, "/events");
        assert_eq!(events[0]["kind"], "begin");
        assert!(events.as_array().unwrap().contains(&action));
        ask(&mut viewer, &json!({ "restart": true }));
        let state = wait_for(&mut viewer, |said| {
            said.get("state").filter(|state| state["injected"] == json!([])).cloned()
        });
        assert_eq!(state["actions"], json!([]));
    });
}

#[test]
fn two_viewers_see_the_same_and_a_silent_one_loses_frames_alone() {
    served(|address| {
        let _silent = join(address);
        let mut viewers = [join(address), join(address)];
        let width = own(address, "/about")["signals"].as_array().unwrap().len() as u32;
        let seen = viewers.each_mut().map(|viewer| {
            let mut list: Vec<(u64, u32, u32)> = vec![];
            while list.last().is_none_or(|last| last.0 < 150) {
                list.extend(frame(&viewer.read().unwrap()));
            }
            list
        });
        for list in &seen {
            let contiguous =
                |pair: &[(u64, u32, u32)]| pair[0].0 + u64::from(pair[0].1) == pair[1].0;
            assert!(list.windows(2).all(contiguous) && list.iter().all(|frame| frame.2 == width));
        }
        let [one, other] = seen;
        assert!(one.iter().filter(|frame| other.contains(frame)).count() > 5);
        assert_eq!(own(address, "/counts")["viewers"], 3);
    });
}

#[test]
fn garbage_is_refused_counted_and_without_effect() {
    served(|address| {
        let mut good = join(address);
        let mut bad = join(address);
        let unknown = json!({ "inject": { "fault": "a.b.c", "intensity": 1.0, "onset": "step" } });
        ask(&mut bad, &unknown);
        let refused = wait_for(&mut good, |said| event_of(said, "refused"));
        assert!(refused["why"].as_str().unwrap().contains("no fault 'a.b.c'"), "{refused}");
        let mut sent = 0;
        while sent < 10_000 && bad.send(Message::text("{\"fly\": ")).is_ok() {
            sent += 1;
        }
        assert!(sent > 100, "a few mistakes are forgiven");
        // Whatever is still under way is counted before the viewer is sent away.
        while bad.read().is_ok() {}
        let mut long = join(address);
        let _ = long.send(Message::text(" ".repeat(100_000)));
        while long.read().is_ok() {}
        let counts = own(address, "/counts");
        assert!(counts["refused_requests"].as_u64().unwrap() > 100, "{counts}");
        assert_eq!(counts["viewers"], 1, "{counts}");
        let mut later = [0; 2].map(|_| {
            std::iter::repeat_with(|| good.read().unwrap()).find_map(|m| frame(&m)).unwrap()
        });
        later.sort_unstable();
        assert!(later[0].0 < later[1].0, "the flight goes on");
    });
}

#[test]
fn a_huge_header_gets_no_answer_but_a_refusal() {
    served(|address| {
        let mut stream = TcpStream::connect(address).unwrap();
        let head = format!("GET /about HTTP/1.1\r\nHost: {address}\r\nX: ");
        // The server may hang up before all of it is sent.
        let _ = stream.write_all(head.as_bytes()).and_then(|()| stream.write_all(&[b'a'; 1 << 20]));
        let mut answer = vec![];
        let _ = stream.read_to_end(&mut answer);
        assert!(answer.is_empty() || answer.starts_with(b"HTTP/1.1 4"), "{answer:?}");
        assert_eq!(own(address, "/about")["kind"], "flight");
    });
}

/// The samples of the same flight without a server: what a fault at full intensity does from a sample on.
fn flown_without_a_server(live: &Live, injected: u64, samples: usize) -> Vec<u32> {
    let scenario = |reacts| ClosedLoop {
        study: &live.study,
        inputs: live.inputs.clone(),
        faults: vec![],
        duration_s: live.duration_s,
        specimen: None,
        reacts,
    };
    let (with, without) = (scenario(true), scenario(false));
    let mut flight = ClosedLoopFlight::new(&with, &live.diagnoser).unwrap();
    let mut ghost = ClosedLoopFlight::new(&without, &live.diagnoser).unwrap();
    let signals = Signals::of_flights(&live.study, &live.diagnoser);
    let (component, fault) = live.study.system.find_fault(FAULT).unwrap();
    let mut values = vec![];
    for sample in 0..samples as u64 {
        if sample == injected {
            let fault = FaultAt { component, fault, intensity: 1.0 };
            flight.inject(vec![fault]);
            ghost.inject(vec![fault]);
        }
        flight.sample().unwrap();
        ghost.sample().unwrap();
        let raised = flight.react().unwrap().map(|action| action.raised);
        signals.fill(&ShownSample { flight: &flight, ghost: &ghost, raised }, &mut values);
    }
    values.into_iter().map(f32::to_bits).collect()
}

#[test]
fn a_session_beside_fifty_viewers_is_the_flight_without_any_to_the_bit() {
    let (live, saved) = (live(), OnceLock::new());
    served_from(&live, |address| {
        let _silent: Vec<_> = (0..25).map(|_| join(address)).collect();
        let mut reading: Vec<_> = (0..25).map(|_| join(address)).collect();
        let mut first = reading.pop().unwrap();
        std::thread::scope(|scope| {
            for viewer in &mut reading {
                scope.spawn(move || wait_for(viewer, |said| event_of(said, "action")));
            }
            wait_for(&mut first, |said| (said["state"]["finding"] == "healthy").then_some(()));
            ask(&mut first, &inject_request());
            wait_for(&mut first, |said| event_of(said, "action"));
        });
        assert_eq!(own(address, "/counts")["viewers"], 50);
        // The state with the action follows a frame, and is saved with the next one.
        let mut frames = std::iter::repeat_with(|| first.read().unwrap()).filter_map(|m| frame(&m));
        frames.nth(1).unwrap();
        saved.set(save(address)).unwrap();
    });
    let session = saved.into_inner().unwrap();
    let texts = messages(&session);
    let event = |kind: &str| texts.iter().find_map(|text| event_of(text, kind)).unwrap();
    let injected_s = event("inject")["time_s"].as_f64().unwrap();
    let injected = (injected_s / live.diagnoser.period_s).round() as u64;
    // Between the time and the messages stand the signals.
    let signals = &session.columns()[1..session.columns().len() - 1];
    let values: Vec<_> = signals.iter().map(|column| session.f64(&column.name).unwrap()).collect();
    let samples = session.row_count();
    let sample = |k: usize| values.iter().map(move |column| (column[k] as f32).to_bits());
    let bits: Vec<u32> = (0..samples).flat_map(sample).collect();
    assert!(flown_without_a_server(&live, injected + 1, samples) == bits, "{samples} samples");
    assert!(texts.iter().any(|text| text["state"]["actions"][0]["action"] == "shut_down"));
    let evidence = session.f64("evidence.actuator_1.shut_down").unwrap();
    assert!(evidence.iter().copied().fold(0.0, f64::max) >= 1.0, "the line reaches the limit");
}
