//! An MQTT subscription: every message has one or more lines.
//!
//! [`client`] keeps the connection, and [`topics`] separates the messages of different topics. Retained messages are
//! counted and dropped, because they are older than the watch.

mod address;
mod client;
mod topics;

pub use address::Subscription;

use super::frame::{self, Flaw};
use super::{LogRow, Read, Source, SourceError, Wanted};
use client::{Mailbox, News};
use std::collections::VecDeque;
use std::sync::mpsc::RecvTimeoutError;
use std::time::{Duration, Instant};
use topics::Topics;

/// How long the columns of several topics are collected after the first message.
const COLLECTING: Duration = Duration::from_secs(2);

/// An active subscription.
pub(crate) struct Mqtt {
    subscription: Subscription,
    mailbox: Mailbox,
    topics: Topics,
    /// The unread lines of the last message, with its topic.
    lines: VecDeque<Vec<u8>>,
    topic: String,
    place: u64,
    is_lost: bool,
}

impl Mqtt {
    /// Connects and subscribes.
    ///
    /// # Errors
    /// The broker is unreachable or rejects the subscription.
    pub(crate) fn open(subscription: &Subscription, wanted: &Wanted) -> Result<Self, SourceError> {
        Ok(Mqtt {
            mailbox: subscribed(subscription)?,
            topics: Topics::new(subscription, wanted),
            subscription: subscription.clone(),
            lines: VecDeque::new(),
            topic: String::new(),
            place: 0,
            is_lost: false,
        })
    }

    /// Handles the next report of the client; `None` for a message with lines.
    fn receive(&mut self) -> Result<Option<Read>, SourceError> {
        Ok(Some(match self.mailbox.next() {
            Err(RecvTimeoutError::Timeout) => Read::Pause,
            Err(RecvTimeoutError::Disconnected) => return Err(ended(&self.subscription)),
            Ok(News::Lost(cause)) => {
                self.is_lost = true;
                Read::Disconnected { cause }
            }
            Ok(News::Subscribed) if self.is_lost => {
                self.is_lost = false;
                Read::Reconnected
            }
            Ok(News::Subscribed) => Read::Nothing,
            Ok(News::TooLong) => {
                self.place += 1;
                Read::Flawed(Flaw::TooLong)
            }
            Ok(News::Message(message)) => {
                self.place += 1;
                if message.retain {
                    return Ok(Some(Read::Flawed(Flaw::Retained { topic: message.topic })));
                }
                let lines = message.payload.split(|&byte| byte == b'\n');
                self.lines.extend(lines.map(<[u8]>::to_vec));
                self.topic = message.topic;
                return Ok(None);
            }
        }))
    }
}

impl Source for Mqtt {
    fn read(&mut self, row: &mut LogRow) -> Result<Read, SourceError> {
        if self.lines.is_empty()
            && let Some(read) = self.receive()?
        {
            row.place = self.place;
            return Ok(read);
        }
        row.place = self.place;
        let Some(line) = self.lines.pop_front() else { return Ok(Read::Nothing) };
        self.topics.read(&self.topic, &line, row)
    }

    fn counted(&self) -> &'static str {
        "message"
    }

    fn is_live(&self) -> bool {
        true
    }
}

/// Connects, and waits until the broker has accepted the subscription.
fn subscribed(subscription: &Subscription) -> Result<Mailbox, SourceError> {
    let mailbox = client::start(subscription).map_err(|cause| failed(subscription, cause))?;
    loop {
        match mailbox.next() {
            Ok(News::Subscribed) => return Ok(mailbox),
            Ok(News::Lost(cause)) => return Err(failed(subscription, cause)),
            // Messages before the acceptance are either retained or would have been missed anyway.
            Ok(News::Message(_) | News::TooLong) | Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => return Err(ended(subscription)),
        }
    }
}

/// The columns of the first message that names any; waits for it. If several topics may send, the columns of all
/// messages within two seconds are collected. A column of two topics is listed as such, and once more for each topic.
///
/// # Errors
/// The broker is unreachable or rejects the subscription.
pub(crate) fn columns(subscription: &Subscription) -> Result<Vec<String>, SourceError> {
    let mailbox = subscribed(subscription)?;
    let mut found: Vec<(String, Vec<String>)> = vec![];
    let mut first = None;
    while first.is_none_or(|first: Instant| first.elapsed() < COLLECTING) {
        match mailbox.next() {
            Ok(News::Message(message)) => {
                let mut lines = message.payload.split(|&byte| byte == b'\n');
                let is_new = found.iter().all(|(topic, _)| *topic != message.topic);
                let named = if is_new { lines.find_map(frame::columns) } else { None };
                let Some(names) = named else { continue };
                found.push((message.topic, names));
                first = first.or(Some(Instant::now()));
                if !subscription.has_several_topics() {
                    break;
                }
            }
            Ok(News::Lost(cause)) => return Err(failed(subscription, cause)),
            Ok(News::Subscribed | News::TooLong) | Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => return Err(ended(subscription)),
        }
    }
    Ok(topics::union(&found))
}

fn failed(subscription: &Subscription, cause: String) -> SourceError {
    SourceError::Connection { address: subscription.to_string(), cause }
}

fn ended(subscription: &Subscription) -> SourceError {
    failed(subscription, "the client has ended".into())
}
