//! `servotwin serve`: a web page beside the running twin.

use super::StudyOptions;
use super::watch::input::{InputOptions, log_of, warn_of_lacking};
use crate::failure::Failure;
use crate::paths::Paths;
use crate::{Global, Run, out, stop};
use servotwin::learn::model_file;
use servotwin::signal::Signal;
use servotwin::study::{Scenario, Study};
use servotwin_diagnosis::diagnoser::Diagnoser;
use servotwin_model::spec::Unit;
use servotwin_serve::{Access, Live, LiveSource, Server, Stream};
use servotwin_view::document::Document;
use servotwin_watch::guard::needed;
use servotwin_watch::source::Address;
use servotwin_watch::watchdog::WatchdogRules;
use std::io::Write;
use std::net::IpAddr;
use std::sync::atomic::Ordering;
use std::sync::{Arc, Mutex};
use std::time::Duration;

/// Open a web page that shows a flying actuator or a stream live.
///
/// You inject faults into the actuator, and watch residuals, diagnosis and reaction. The plant and its twin fly in
/// real time, with the diagnosis and a flight control computer that reacts, and a ghost flies the same without them.
/// --source shows a live stream instead. The page of a log is written by servotwin watch --html. The page is at 127.0.0.1 unless you name another address; then the printed link has a
/// token, without which nobody comes in. Ctrl-C ends it. The built-in aileron flies with a diagnosis that comes with
/// the program; for anything else the command trains one first if it is missing, which takes about two minutes.
#[derive(clap::Args)]
pub(crate) struct Options {
    #[command(flatten)]
    study: StudyOptions,
    /// The address to listen on.
    #[arg(long, value_name = "IP", default_value = "127.0.0.1")]
    address: IpAddr,
    /// The port; 0 takes a free one.
    #[arg(long, value_name = "PORT", default_value_t = 8470)]
    port: u16,
    /// Show this stream instead of a flight: - for lines from standard input, or udp://HOST:PORT to listen on.
    #[arg(long, value_name = "SOURCE", conflicts_with_all = ["command", "specimen"])]
    source: Option<String>,
    #[command(flatten)]
    input: InputOptions,
    /// The command signal [default: noise that moves the surface all the time].
    #[arg(long, value_name = "SIGNAL")]
    command: Option<Signal>,
    /// End when standard input closes. A program that starts this command ends it that way, also when the program is
    /// killed.
    #[arg(long)]
    end_with_stdin: bool,
    /// The number of the specimen that flies. Each number has its own tolerances [default: a specimen that equals the
    /// twin].
    #[arg(long, value_name = "NUMBER")]
    specimen: Option<usize>,
}

impl Run for Options {
    fn paths(&self) -> Paths {
        let InputOptions { model, map, .. } = &self.input;
        Paths::default().read("the diagnoser", model).read("--map", map)
    }

    fn run(&self, global: Global) -> Result<Document, Failure> {
        stop::heed();
        if let Some(log) = self.source.as_ref().filter(|source| log_of(source).is_some()) {
            return Err(Failure::usage(format!(
                "{log} is a file, and --source shows a stream: servotwin watch {log} --html FILE writes its page"
            )));
        }
        if self.end_with_stdin {
            if self.source.as_deref() == Some("-") {
                return Err(Failure::usage(
                    "--source - reads standard input, so --end-with-stdin cannot wait for its end",
                ));
            }
            end_with_stdin();
        }
        let study = self.study.read(global)?;
        let server = Server::listen(Access::to((self.address, self.port).into())?)?;
        let Some(source) = &self.source else {
            return show(server, &live(self, study, global)?);
        };
        // A source that cannot be opened fails before training takes its time.
        let address = Address::parse(source)?;
        let (map, rows) = self.input.open(&address, &study, self.study.is_named(), global)?;
        let diagnoser = diagnoser(self, &study, Scenario::Realistic, global)?;
        warn_of_lacking(&map, &needed(&diagnoser, &study.system), global);
        let stream = Stream {
            title: format!("{}: {address}", study.system.title),
            study: &study,
            silence: WatchdogRules::of_period(diagnoser.period_s),
            diagnoser,
            map,
            rows: Mutex::new(rows),
        };
        show(server, &stream)
    }
}

/// The time that the command has to end by itself when standard input closes. Training would take longer.
const GRACE: Duration = Duration::from_secs(5);

/// Stops the command when standard input closes. The thread ends with the process.
fn end_with_stdin() {
    std::thread::spawn(|| {
        // An input that cannot be read is as good as closed.
        let _ = std::io::copy(&mut std::io::stdin().lock(), &mut std::io::sink());
        stop::flag().store(true, Ordering::Relaxed);
        std::thread::sleep(GRACE);
        // As at a second Ctrl-C: files are replaced only when they are complete.
        std::process::exit(i32::from(Failure::stopped().exit_code));
    });
}

/// Prints the link and serves a source until Ctrl-C.
fn show(server: Server, source: &dyn LiveSource) -> Result<Document, Failure> {
    // Whoever started the command waits for the link, which is a stream's only line.
    let _ = writeln!(out::stdout(), "{}", server.link());
    let _ = out::stdout().flush();
    server.run(source, stop::flag())?;
    Ok(Document::raw(String::new()))
}

/// The diagnoser that the options name, or that of `servotwin fly`.
fn diagnoser(
    options: &Options,
    study: &Study,
    scenario: Scenario,
    global: Global,
) -> Result<Arc<Diagnoser>, Failure> {
    if let Some(path) = &options.input.model {
        return Ok(Arc::new(model_file::read_diagnoser(path)?));
    }
    let folder = options.study.folder();
    super::fly::diagnoser(&options.study, &folder, study, scenario, global)
}

/// The duration of a flight; then the next one begins, s.
const DURATION_S: f64 = 3600.0;

/// The flight of a study.
fn live(options: &Options, study: Study, global: Global) -> Result<Live, Failure> {
    let scenario = if options.specimen.is_some() { Scenario::Realistic } else { Scenario::Noise };
    let diagnoser = diagnoser(options, &study, scenario, global)?;
    let mut inputs = study.system.default_inputs();
    let unit = study.system.network().inputs[study.command_input].unit;
    let signal = options.command.clone().unwrap_or_else(|| usual_command(unit));
    let signal = signal.build(unit, DURATION_S);
    inputs[study.command_input] = signal.map_err(|error| Failure::signal("--command", &error))?;
    let (duration_s, specimen) = (DURATION_S, options.specimen);
    Ok(Live { study, diagnoser, inputs, duration_s, specimen })
}

/// A command that keeps the actuator moving.
fn usual_command(unit: Unit) -> Signal {
    let size = if unit == Unit::Radian { "4deg" } else { "4mm" };
    format!("noise:rms={size},bandwidth=0.7Hz,seed=5").parse().expect("a signal of the catalogue")
}
