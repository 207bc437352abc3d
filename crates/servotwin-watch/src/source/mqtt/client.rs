//! Keeps the connection to a broker on a separate thread.
//!
//! `rumqttc` implements the protocol (MQTT 3.1.1). This thread adds three things. A ping without an answer within half
//! a keep-alive interval ends the connection. Lost connections are restored with growing pauses. Both are reported.

use super::super::live::News;
use super::super::{PAUSE, Read};
use super::address::{Authority, Subscription};
use crate::counts::Irregularity;
use rumqttc::{
    Client, Connection, ConnectionError, Event, MqttOptions, Outgoing, Packet, QoS,
    RecvTimeoutError, StateError, SubscribeReasonCode, Transport, mqttbytes,
};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::sync::{Arc, Weak};
use std::thread;
use std::time::{Duration, Instant};

/// The longest message whose lines are read, bytes.
const MAX_MESSAGE: usize = 1 << 20;

/// The longest packet that MQTT allows, bytes. With a smaller limit, a long message would end the connection.
const MAX_PACKET: usize = 268_435_455;

/// The most messages that wait to be read; beyond that, the broker waits.
const WAITING: usize = 1024;

/// How long a broker may take to answer.
const PATIENCE: Duration = Duration::from_secs(5);

/// The first pause between two attempts to connect; it doubles up to the longest.
const FIRST_PAUSE: Duration = Duration::from_millis(250);
const LONGEST_PAUSE: Duration = Duration::from_secs(8);

/// What the thread reports; dropping it ends the thread.
pub(super) struct Mailbox {
    /// Messages, and losses of the connection. [`Read::Reconnected`] follows each acceptance of the subscription.
    pub news: Receiver<News<()>>,
    /// The thread ends when nobody holds this.
    pub alive: Arc<()>,
}

/// Connects and subscribes, and reconnects without limit. Messages that the broker has stored earlier are flaws, unless
/// they are wanted.
///
/// # Errors
/// The certificate file cannot be read or is empty.
pub(super) fn start(subscription: &Subscription, wants_retained: bool) -> Result<Mailbox, String> {
    let (client, mut connection) = Client::new(options(subscription)?, 10);
    let mut network = connection.eventloop.network_options();
    network.set_connection_timeout(PATIENCE.as_secs());
    network.set_tcp_nodelay(true);
    connection.eventloop.set_network_options(network);
    let (send, news) = sync_channel(WAITING);
    let alive = Arc::new(());
    let mut keeper = Keeper {
        client,
        connection,
        subscription: subscription.clone(),
        wants_retained,
        send,
        watch: Arc::downgrade(&alive),
        is_connected: false,
        answer_by: None,
        pause: FIRST_PAUSE,
    };
    thread::spawn(move || keeper.run());
    Ok(Mailbox { news, alive })
}

fn options(subscription: &Subscription) -> Result<MqttOptions, String> {
    // Set a client name: some brokers assign none. The process id distinguishes two watches started at the same moment.
    let nanos = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH);
    let nanos = nanos.map_or(0, |since| since.subsec_nanos());
    let name = format!("servotwin{:05x}{nanos:08x}", std::process::id() & 0xf_ffff);
    let mut options = MqttOptions::new(name, &subscription.host, subscription.port);
    options.set_keep_alive(subscription.keep_alive);
    options.set_max_packet_size(MAX_PACKET, MAX_PACKET);
    // The broker does not resend messages missed during a loss: they would be late.
    options.set_clean_session(true);
    if let Some((name, password)) = &subscription.user {
        options.set_credentials(name, password);
    }
    if let Some(authority) = &subscription.tls {
        options.set_transport(transport(authority)?);
    }
    Ok(options)
}

#[cfg(feature = "mqtt-tls")]
fn transport(authority: &Authority) -> Result<Transport, String> {
    use rustls::pki_types::{CertificateDer, pem::PemObject};
    use servotwin_io::files;
    let mut roots = rustls::RootCertStore::empty();
    match authority {
        Authority::System => {
            roots.add_parsable_certificates(rustls_native_certs::load_native_certs().certs);
        }
        Authority::File(path) => {
            let text = files::read_bytes(path).map_err(|error| error.to_string())?;
            let found = CertificateDer::pem_slice_iter(&text).collect::<Result<Vec<_>, _>>();
            let failed = |cause| format!("{}: {cause}", path.display());
            roots.add_parsable_certificates(found.map_err(failed)?);
        }
    }
    if roots.is_empty() {
        return Err("no certificate of an authority was found; ca=FILE names one in PEM".into());
    }
    let provider = Arc::new(rustls::crypto::ring::default_provider());
    let config = rustls::ClientConfig::builder_with_provider(provider)
        .with_safe_default_protocol_versions()
        .map_err(|cause| cause.to_string())?
        .with_root_certificates(roots)
        .with_no_client_auth();
    Ok(Transport::tls_with_config(config.into()))
}

#[cfg(not(feature = "mqtt-tls"))]
fn transport(_: &Authority) -> Result<Transport, String> {
    Err(super::super::feature_needed("mqtts://", "mqtt-tls").to_string())
}

struct Keeper {
    client: Client,
    connection: Connection,
    subscription: Subscription,
    wants_retained: bool,
    send: SyncSender<News<()>>,
    watch: Weak<()>,
    is_connected: bool,
    /// The deadline for answering a ping or a subscription.
    answer_by: Option<Instant>,
    pause: Duration,
}

impl Keeper {
    fn run(&mut self) {
        let mut is_told = false;
        while self.watch.strong_count() > 0 {
            let news = match self.step() {
                Ok(None) => continue,
                Ok(Some(news)) => vec![news],
                Err(cause) => self.lose(cause),
            };
            for news in news {
                let is_lost = matches!(news, News::Other(Read::Disconnected { .. }));
                // An outage is reported once, however many attempts fail.
                if !(is_lost && is_told) && self.send.send(news).is_err() {
                    return;
                }
                is_told = is_lost;
            }
            if is_told {
                self.rest();
            }
        }
    }

    /// Drops the connection. Packets received before the loss are reported first.
    fn lose(&mut self, mut cause: String) -> Vec<News<()>> {
        let mut news = vec![];
        for event in std::mem::take(&mut self.connection.eventloop.state.events) {
            let Event::Incoming(packet) = event else { continue };
            match self.take(packet) {
                Ok(found) => news.extend(found),
                // The connection ends because of this error.
                Err(earlier) => {
                    cause = earlier;
                    break;
                }
            }
        }
        self.connection.eventloop.clean();
        (self.is_connected, self.answer_by) = (false, None);
        news.push(News::Other(Read::Disconnected { cause }));
        news
    }

    /// Handles one event of the connection, or detects a silent broker.
    fn step(&mut self) -> Result<Option<News<()>>, String> {
        // A connection attempt has its own time limit; abandoning it here would restart it.
        let event = match self.is_connected {
            false => self.connection.recv().map_err(|_| "the client has ended".to_owned())?,
            true => match self.connection.recv_timeout(PAUSE) {
                Ok(event) => event,
                Err(RecvTimeoutError::Timeout) => return self.answered().map(|()| None),
                Err(RecvTimeoutError::Disconnected) => return Err("the client has ended".into()),
            },
        };
        let news = match event.map_err(|error| cause(&error))? {
            Event::Incoming(packet) => {
                // Queued messages arrive before the answer to a ping, so each packet extends its deadline.
                self.answer_by = self.answer_by.map(|_| self.next_answer());
                return self.take(packet);
            }
            Event::Outgoing(Outgoing::PingReq) => {
                self.answer_by = Some(self.next_answer());
                None
            }
            Event::Outgoing(_) => None,
        };
        self.answered().map(|()| news)
    }

    fn take(&mut self, packet: Packet) -> Result<Option<News<()>>, String> {
        let flawed = |kind: Irregularity| Some(News::Other(Read::Flawed(kind.into())));
        match packet {
            Packet::ConnAck(_) => {
                let qos =
                    if self.subscription.qos == 0 { QoS::AtMostOnce } else { QoS::AtLeastOnce };
                let asked = self.client.try_subscribe(&self.subscription.topic, qos);
                asked.map_err(|error| error.to_string())?;
                (self.is_connected, self.answer_by) = (true, Some(Instant::now() + PATIENCE));
                Ok(None)
            }
            Packet::SubAck(answer) => {
                if answer.return_codes.contains(&SubscribeReasonCode::Failure) {
                    let topic = &self.subscription.topic;
                    return Err(format!("the broker refuses the subscription to {topic}"));
                }
                (self.answer_by, self.pause) = (None, FIRST_PAUSE);
                Ok(Some(News::Other(Read::Reconnected)))
            }
            Packet::PingResp => {
                self.answer_by = None;
                Ok(None)
            }
            Packet::Publish(message) if message.payload.len() > MAX_MESSAGE => {
                Ok(flawed(Irregularity::TooLong))
            }
            Packet::Publish(message) if message.retain && !self.wants_retained => {
                Ok(flawed(Irregularity::Retained))
            }
            Packet::Publish(message) => Ok(Some(News::Lines((), message.payload.to_vec()))),
            Packet::Disconnect => Err("the broker ended the connection".into()),
            _ => Ok(None),
        }
    }

    /// The deadline for a ping sent now.
    fn next_answer(&self) -> Instant {
        Instant::now() + self.subscription.keep_alive / 2
    }

    /// Fails when an answer is overdue.
    fn answered(&self) -> Result<(), String> {
        match self.answer_by {
            Some(by) if Instant::now() >= by => Err("the broker does not answer".into()),
            _ => Ok(()),
        }
    }

    /// Waits before the next attempt; the pause grows each time.
    fn rest(&mut self) {
        let end = Instant::now() + self.pause;
        while Instant::now() < end && self.watch.strong_count() > 0 {
            thread::sleep(PAUSE.min(self.pause));
        }
        self.pause = (2 * self.pause).min(LONGEST_PAUSE);
    }
}

/// The reason why a connection ended.
fn cause(error: &ConnectionError) -> String {
    use rumqttc::ConnectReturnCode as Code;
    match error {
        ConnectionError::ConnectionRefused(code) => match code {
            Code::RefusedProtocolVersion => "the broker does not know MQTT 3.1.1".into(),
            Code::BadClientId => "the broker refuses our name".into(),
            Code::ServiceUnavailable => "the broker does not serve".into(),
            Code::BadUserNamePassword => "wrong user or password".into(),
            Code::NotAuthorized => "not allowed".into(),
            Code::Success => "the broker refuses".into(),
        },
        ConnectionError::NetworkTimeout | ConnectionError::FlushTimeout => {
            format!("no answer within {} s", PATIENCE.as_secs())
        }
        ConnectionError::Io(error) | ConnectionError::MqttState(StateError::Io(error)) => {
            error.to_string()
        }
        ConnectionError::MqttState(StateError::ConnectionAborted) => {
            "the broker closed the connection".into()
        }
        ConnectionError::MqttState(StateError::AwaitPingResp) => {
            "the broker does not answer".into()
        }
        ConnectionError::MqttState(StateError::Deserialization(error)) => match error {
            mqttbytes::Error::Io(error) => error.to_string(),
            error => format!("a damaged packet ({error})"),
        },
        ConnectionError::NotConnAck(_) => "the answer is not that of a broker".into(),
        error => error.to_string(),
    }
}
