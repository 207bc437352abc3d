//! The present flight as a table: everything that its viewers were sent, in this order.

use crate::feed::{Message, values_in};
use servotwin::table::{Column, Table, TableError};
use servotwin_watch::player::PlayerSignal;

/// The column of events and states: at the first sample of a frame one JSON object a line, as sent before that frame.
const MESSAGES: &str = "messages";

/// One row for each sample of the diagnosis up to the last full frame: its time, all signals, and what was sent.
///
/// # Errors
/// Two signals have the same id.
pub(crate) fn table_of(
    period_s: f64,
    list: &[PlayerSignal],
    sent: &[Message],
) -> Result<Table, TableError> {
    let mut signals = vec![vec![]; list.len()];
    let (mut messages, mut waiting) = (vec![], vec![]);
    for message in sent {
        match message {
            Message::Event(event) => waiting.push(format!("{{\"event\":{event}}}")),
            Message::State(state) => waiting.push(format!("{{\"state\":{state}}}")),
            Message::Frame(bytes) => {
                for (place, value) in values_in(bytes).enumerate() {
                    signals[place % list.len()].push(f64::from(value));
                }
                messages.push(std::mem::take(&mut waiting).join("\n"));
                messages.resize(signals[0].len(), String::new());
            }
        }
    }
    let times_s: Vec<f64> = (0..messages.len()).map(|k| k as f64 * period_s).collect();
    let columns = list.iter().zip(signals);
    let columns = columns.map(|(signal, values)| Column::new(&*signal.id, &*signal.unit, values));
    let time = std::iter::once(Column::new("time_s", "s", times_s));
    let messages = std::iter::once(Column::new(MESSAGES, "", messages));
    Table::from_columns(time.chain(columns).chain(messages).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::feed::Frames;
    use servotwin_watch::player::SignalGroup;

    #[test]
    fn a_flight_is_a_table_with_its_events_between_the_samples() {
        let frame = |first: u64| {
            Frames::frame_of(first, 1, &[0.1 * first as f32, 0.1 * (first + 1) as f32])
        };
        let state = Message::State(r#"{"confidence":0.30000000000000004}"#.into());
        let sent = [Message::Event("{}".into()), state, frame(0), frame(2)];
        let signal = PlayerSignal::new("a", "a", "kN", SignalGroup::Fight);
        let table = table_of(0.01, &[signal], &sent).unwrap();
        assert_eq!((table.row_count(), table.columns()[1].unit.as_str()), (4, "kN"));
        let expected = [0.0, 0.1, 0.2, 0.3_f32].map(f64::from);
        assert!(
            table
                .f64("a")
                .unwrap()
                .iter()
                .zip(expected)
                .all(|(one, other)| (one - other).abs() < 1e-7)
        );
        let first = &table.text(MESSAGES).unwrap()[0];
        assert_eq!(first, "{\"event\":{}}\n{\"state\":{\"confidence\":0.30000000000000004}}");
    }
}
