//! An MQTT subscription: every message has one or more lines.
//!
//! [`client`] keeps the connection. Retained messages are counted and dropped, because they are older than the watch.

mod address;
mod client;

pub use address::Subscription;

use super::frame::{self, Frames};
use super::live::{Live, News};
use super::{LogRow, PAUSE, Read, Source, SourceError, Wanted};
use client::Mailbox;
use std::sync::mpsc::RecvTimeoutError;

/// Connects and subscribes.
///
/// # Errors
/// The broker is unreachable or rejects the subscription.
pub(super) fn open(
    subscription: &Subscription,
    wanted: &Wanted,
) -> Result<Box<dyn Source>, SourceError> {
    let Mailbox { news, alive } = subscribed(subscription, false)?;
    let mut frames = Frames::new(wanted);
    let read = move |(): &(), line: &[u8], row: &mut LogRow| {
        // The client lives as long as its reader.
        let _alive = &alive;
        Ok(frames.read(line, row))
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
fn next(mailbox: &Mailbox, subscription: &Subscription) -> Result<Option<News<()>>, SourceError> {
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

/// The columns of the first message that names any; waits for it.
///
/// # Errors
/// The broker is unreachable or rejects the subscription.
pub(crate) fn columns(subscription: &Subscription) -> Result<Vec<String>, SourceError> {
    let mailbox = subscribed(subscription, true)?;
    loop {
        let Some(News::Lines((), message)) = next(&mailbox, subscription)? else { continue };
        if let Some(names) = message.split(|&byte| byte == b'\n').find_map(frame::columns) {
            return Ok(names);
        }
    }
}

fn failed(subscription: &Subscription, cause: String) -> SourceError {
    SourceError::Connection { address: subscription.to_string(), cause }
}
