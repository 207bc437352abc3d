//! The address of an MQTT subscription.

use std::fmt;
use std::path::PathBuf;
use std::time::Duration;

/// The default keep-alive interval.
const KEEP_ALIVE: Duration = Duration::from_secs(10);

/// The broker and the topic of a subscription.
#[derive(Clone, PartialEq, Eq)]
pub struct Subscription {
    /// The host; an IPv6 address is in brackets.
    pub host: String,
    /// The TCP port.
    pub port: u16,
    /// User name and password, if given.
    pub user: Option<(String, String)>,
    /// The topic, without wildcards: the values of two actuators must not be mixed.
    pub topic: String,
    /// The quality of service: 0 at most once, 1 at least once.
    pub qos: u8,
    /// The keep-alive interval. A broker that is silent for one and a half times this long counts as lost.
    pub keep_alive: Duration,
    /// `Some` for an encrypted connection: the certificates that authenticate the broker.
    pub tls: Option<Authority>,
}

/// The certificates that authenticate the broker.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Authority {
    /// The certificates of the operating system.
    System,
    /// A file of certificates in PEM.
    File(PathBuf),
}

impl Subscription {
    /// The form of an address, for messages.
    pub(crate) const FORM: &str = "mqtt[s]://[USER:PASSWORD@]HOST[:PORT]/TOPIC[?qos=0 or 1&keep_alive=1…3600 in s&ca=FILE for \
        mqtts], with one topic without + and #,";

    /// Parses `mqtt://[user:password@]host[:port]/topic[?qos=1&keep_alive=10]`. The default port is 1883, or
    /// 8883 for `mqtts://`, which also accepts `ca=FILE`.
    pub(crate) fn parse(text: &str) -> Option<Self> {
        let (rest, is_tls) = match text.strip_prefix("mqtts://") {
            Some(rest) => (rest, true),
            None => (text.strip_prefix("mqtt://")?, false),
        };
        let (rest, options) = match rest.split_once('?') {
            Some((rest, options)) => (rest, Some(options)),
            None => (rest, None),
        };
        let (place, topic) = rest.split_once('/')?;
        let (user, host) = match place.rsplit_once('@') {
            Some((user, host)) => {
                let (name, password) = user.split_once(':').unwrap_or((user, ""));
                (Some((name.to_owned(), password.to_owned())), host)
            }
            None => (None, place),
        };
        let (host, port) = host_and_port(host, if is_tls { 8883 } else { 1883 })?;
        let tls = is_tls.then_some(Authority::System);
        let (topic, qos, keep_alive) = (topic.to_owned(), 0, KEEP_ALIVE);
        let mut found = Subscription { host, port, user, topic, qos, keep_alive, tls };
        for option in options.iter().flat_map(|options| options.split('&')) {
            found.set(option)?;
        }
        (!found.topic.is_empty() && rumqttc::valid_topic(&found.topic)).then_some(found)
    }

    fn set(&mut self, option: &str) -> Option<()> {
        match option.split_once('=')? {
            ("qos", "0") => self.qos = 0,
            ("qos", "1") => self.qos = 1,
            ("keep_alive", text) => {
                let seconds = text.parse().ok().filter(|seconds| (1..=3600).contains(seconds))?;
                self.keep_alive = Duration::from_secs(seconds);
            }
            ("ca", path) if self.tls.is_some() && !path.is_empty() => {
                self.tls = Some(Authority::File(path.into()));
            }
            _ => return None,
        }
        Some(())
    }
}

/// Splits `host`, `host:port`, `[v6]` or `[v6]:port`.
fn host_and_port(text: &str, usual: u16) -> Option<(String, u16)> {
    let end = if text.starts_with('[') {
        text.find(']')? + 1
    } else {
        text.find(':').unwrap_or(text.len())
    };
    let (host, port) = text.split_at(end);
    let port = match port.strip_prefix(':') {
        Some(port) => port.parse().ok()?,
        None if port.is_empty() => usual,
        None => return None,
    };
    (!host.is_empty()).then(|| (host.to_owned(), port))
}

impl fmt::Display for Subscription {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        // Titles and messages must not show the password.
        let secure = if self.tls.is_some() { "s" } else { "" };
        write!(out, "mqtt{secure}://{}:{}/{}", self.host, self.port, self.topic)
    }
}

impl fmt::Debug for Subscription {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(out, "{self}?qos={}&keep_alive={}", self.qos, self.keep_alive.as_secs())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_address_names_broker_topic_and_quality() {
        let parse = Subscription::parse;
        assert_eq!(parse("mqtt://me:se/cret@rig:1884/a/b?qos=1"), None, "a slash ends the host");
        let full = parse("mqtt://me:secret@rig:1884/a/b?qos=1&keep_alive=3").unwrap();
        assert_eq!(full.user, Some(("me".into(), "secret".into())));
        assert_eq!((&*full.host, full.port, full.qos), ("rig", 1884, 1));
        assert_eq!(full.topic, "a/b");
        assert_eq!(full.keep_alive, Duration::from_secs(3));
        let plain = parse("mqtt://rig/a").unwrap();
        assert_eq!((plain.port, plain.tls), (1883, None));
        let secure = parse("mqtts://[::1]/a?ca=rig.pem").unwrap();
        assert_eq!((&*secure.host, secure.port), ("[::1]", 8883));
        assert_eq!(secure.tls, Some(Authority::File("rig.pem".into())));
        let wrong = [
            "rig",
            "rig/",
            "/a",
            "rig/a?qos=2",
            "rig/a?keep_alive=0",
            "rig/a?ca=x",
            "rig/a/+",
            "rig/#",
            "rig:/a",
            "[::1/a",
            "rig/a?word",
            ":1883/a",
        ];
        for wrong in wrong {
            assert_eq!(parse(&format!("mqtt://{wrong}")), None, "{wrong}");
        }
    }

    #[test]
    fn a_password_is_never_shown() {
        let found = Subscription::parse("mqtt://me:secret@rig/a").unwrap();
        assert_eq!(found.to_string(), "mqtt://rig:1883/a");
        assert!(!format!("{found:?}").contains("secret"));
    }
}
