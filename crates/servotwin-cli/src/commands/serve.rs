//! `servotwin serve`: a web page beside the running twin.

use super::StudyOptions;
use crate::Global;
use crate::failure::Failure;
use crate::paths::{Format, Paths};
use servotwin::signal::Signal;
use std::net::IpAddr;
#[cfg(feature = "serve")]
use std::path::Path;
use std::path::PathBuf;

/// Open a web page on which you inject faults into a flying actuator and watch residuals, diagnosis and reaction live.
///
/// The plant and its twin fly in real time, with the diagnosis and a flight control computer that reacts, and a ghost
/// flies the same without them. The page is at 127.0.0.1 unless you name another address; then the printed link has a
/// token, without which nobody comes in. Ctrl-C ends it. If the diagnoser is missing, the command trains it first, which
/// takes about two minutes.
#[derive(clap::Args)]
pub struct Options {
    #[command(flatten)]
    study: StudyOptions,
    /// The address to listen on.
    #[arg(long, value_name = "IP", default_value = "127.0.0.1")]
    address: IpAddr,
    /// The port; 0 takes a free one.
    #[arg(long, value_name = "PORT", default_value_t = 8470)]
    port: u16,
    /// The command signal [default: noise that moves the surface all the time].
    #[arg(long, value_name = "SIGNAL")]
    command: Option<Signal>,
    /// Replay a session that was saved on the page, instead of a flight.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["study", "command", "specimen"])]
    replay: Option<PathBuf>,
    /// Write the replayed session as one page that any browser plays without a server, instead of serving it.
    #[arg(long, value_name = "FILE", requires = "replay")]
    html: Option<PathBuf>,
    /// End when standard input closes. A program that starts this command ends it that way, also when the program is
    /// killed.
    #[arg(long)]
    end_with_stdin: bool,
    /// The number of the specimen that flies. Each number has its own tolerances [default: a specimen that equals the
    /// twin].
    #[arg(long, value_name = "NUMBER")]
    specimen: Option<usize>,
}

impl Options {
    /// The files of the command.
    pub fn paths(&self) -> Paths {
        Paths::default().read("the session", &self.replay).write("--html", Format::HTML, &self.html)
    }
}

#[cfg(not(feature = "serve"))]
pub fn run(_: &Options, _: Global) -> Result<String, Failure> {
    Err(Failure::Options(
        "this servotwin was built without its web page. Build it in: cargo install --path crates/servotwin-cli \
         --features serve (or cargo run --release --features serve -- serve)",
    ))
}

#[cfg(feature = "serve")]
pub fn run(options: &Options, global: Global) -> Result<String, Failure> {
    use servotwin_serve::{Access, Server, Session};

    if let (Some(session), Some(html)) = (&options.replay, &options.html) {
        return save_page(session, html, global);
    }
    crate::stop::heed();
    if options.end_with_stdin {
        end_with_stdin();
    }
    let access = || Access::to((options.address, options.port).into());
    if let Some(path) = &options.replay {
        let session = Session::read(path).map_err(servotwin_serve::ServeError::from)?;
        return show(Server::listen(access()?)?, &session);
    }
    let study = options.study.read(global)?;
    let server = Server::listen(access()?)?;
    show(server, &live(options, study, global)?)
}

/// Writes a saved session as a page that plays it without a server.
#[cfg(feature = "serve")]
fn save_page(session: &Path, page: &Path, global: Global) -> Result<String, Failure> {
    use servotwin::files::write_atomically;
    use servotwin_serve::{ServeError, Session, saved_page};

    let html = saved_page(&Session::read(session).map_err(ServeError::from)?);
    write_atomically(page, |out| out.write_all(html.as_bytes()))?;
    let page = page.display().to_string();
    Ok(match global {
        Global { json: true, .. } => crate::render::json(&serde_json::json!({ "page": page })),
        Global { quiet: true, .. } => String::new(),
        _ => format!("{page}\n"),
    })
}

/// Stops the command when standard input closes. The thread ends with the process.
#[cfg(feature = "serve")]
fn end_with_stdin() {
    /// The time that the command has to end by itself. Training would take longer.
    const GRACE: std::time::Duration = std::time::Duration::from_secs(5);

    std::thread::spawn(|| {
        // An input that cannot be read is as good as closed.
        let _ = std::io::copy(&mut std::io::stdin().lock(), &mut std::io::sink());
        crate::stop::flag().store(true, std::sync::atomic::Ordering::Relaxed);
        std::thread::sleep(GRACE);
        // As at a second Ctrl-C: files are replaced only when they are complete.
        std::process::exit(i32::from(Failure::Stopped.exit_code()));
    });
}

/// Prints the link and serves a source until Ctrl-C.
#[cfg(feature = "serve")]
fn show(
    server: servotwin_serve::Server,
    source: &impl servotwin_serve::Source,
) -> Result<String, Failure> {
    use std::io::Write;

    // The link is the result, and whoever started the command waits for it.
    let _ = writeln!(crate::out::stdout(), "{}", server.link());
    let _ = crate::out::stdout().flush();
    server.run(source, crate::stop::flag())?;
    Ok(String::new())
}

/// The flight of a study.
#[cfg(feature = "serve")]
fn live(
    options: &Options,
    study: servotwin::study::Study,
    global: Global,
) -> Result<servotwin_serve::Live, Failure> {
    use servotwin::job::Folder;
    use servotwin::study::Setting;

    /// The duration of a flight; then the next one begins, s.
    const DURATION_S: f64 = 3600.0;

    let setting = if options.specimen.is_some() { Setting::Realistic } else { Setting::Noise };
    let folder = Folder::new(&options.study.out);
    let diagnoser = super::fly::diagnoser(&options.study, &folder, &study, setting, global)?;
    let mut inputs = study.system.default_inputs();
    let unit = study.system.network().inputs[study.command_input].unit;
    let signal = options.command.clone().unwrap_or_else(|| usual_command(unit));
    inputs[study.command_input] = signal
        .build(unit, DURATION_S)
        .map_err(|error| Failure::Signal { option: "--command".into(), error })?;
    let (duration_s, specimen) = (DURATION_S, options.specimen);
    Ok(servotwin_serve::Live { study, diagnoser, inputs, duration_s, specimen })
}

/// A command that keeps the actuator moving.
#[cfg(feature = "serve")]
fn usual_command(unit: servotwin_model::spec::Unit) -> Signal {
    let size = match unit {
        servotwin_model::spec::Unit::Radian => "4deg",
        _ => "4mm",
    };
    format!("noise:rms={size},bandwidth=0.7Hz,seed=5").parse().expect("a signal of the catalogue")
}
