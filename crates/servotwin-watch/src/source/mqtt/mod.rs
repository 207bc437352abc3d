//! An MQTT subscription: every message has one or more lines.
//!
//! [`client`] keeps the connection, and [`topics`] separates the messages of different topics. Retained messages are
//! counted and dropped, because they are older than the watch.

mod address;
mod client;
mod topics;

pub use address::Subscription;

use super::frame;
use super::live::{Live, News};
use super::{LogRow, PAUSE, Read, Source, SourceError, Wanted};
use client::Mailbox;
use std::sync::mpsc::RecvTimeoutError;
use std::time::{Duration, Instant};
use topics::Topics;

/// How long the columns of several topics are collected after the first message.
const COLLECTING: Duration = Duration::from_secs(2);

/// Connects and subscribes.
///
/// # Errors
/// The broker is unreachable or rejects the subscription.
pub(super) fn open(
    subscription: &Subscription,
    wanted: &Wanted,
) -> Result<Box<dyn Source>, SourceError> {
    let Mailbox { news, alive } = subscribed(subscription, false)?;
    let mut topics = Topics::new(subscription, wanted);
    let read = move |topic: &String, line: &[u8], row: &mut LogRow| {
        // The client lives as long as its reader.
        let _alive = &alive;
        topics.read(topic, line, row)
    };
    Ok(Box::new(Live::new(subscription.to_string(), "message", news, read)))
}

/// Connects, and waits until the broker has accepted the subscription.
fn subscribed(subscription: &Subscription, wants_retained: bool) -> Result<Mailbox, SourceError> {
    let started = client::start(subscription, wants_retained);
    let mailbox = started.map_err(|cause| failed(subscription, cause))?;
    // Messages before the acceptance are either retained or would have been missed anyway.
    while !matches!(next(&mailbox, subscription)?, Some(News::Other(Read::Reconnected))) {}
    Ok(mailbox)
}

/// What the client reports within [`PAUSE`].
fn next(
    mailbox: &Mailbox,
    subscription: &Subscription,
) -> Result<Option<News<String>>, SourceError> {
    match mailbox.news.recv_timeout(PAUSE) {
        Ok(News::Other(Read::Disconnected { cause }) | News::Failed(cause)) => {
            Err(failed(subscription, cause))
        }
        Ok(news) => Ok(Some(news)),
        Err(RecvTimeoutError::Timeout) => Ok(None),
        Err(RecvTimeoutError::Disconnected) => {
            Err(failed(subscription, "the client has ended".into()))
        }
    }
}

/// The columns of the first message that names any; waits for it. If several topics may send, the columns of all
/// messages within two seconds are collected. A column of two topics is listed as such, and once more for each topic.
///
/// # Errors
/// The broker is unreachable or rejects the subscription.
pub(crate) fn columns(subscription: &Subscription) -> Result<Vec<String>, SourceError> {
    let mailbox = subscribed(subscription, true)?;
    let mut found: Vec<(String, Vec<String>)> = vec![];
    let mut first = None;
    while first.is_none_or(|first: Instant| first.elapsed() < COLLECTING) {
        let Some(News::Lines(topic, message)) = next(&mailbox, subscription)? else { continue };
        let mut lines = message.split(|&byte| byte == b'\n');
        let is_new = found.iter().all(|(known, _)| *known != topic);
        let named = if is_new { lines.find_map(frame::columns) } else { None };
        let Some(names) = named else { continue };
        found.push((topic, names));
        first = first.or(Some(Instant::now()));
        if !subscription.has_several_topics() {
            break;
        }
    }
    Ok(topics::union(&found))
}

fn failed(subscription: &Subscription, cause: String) -> SourceError {
    SourceError::Connection { address: subscription.to_string(), cause }
}
