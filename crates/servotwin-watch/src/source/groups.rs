//! Groups of columns with separate times: the rows of a recording whose channels have several rates.

use super::{LogRow, Read, Source, SourceError, Wanted};
use crate::counts::Irregularity;

/// Columns with common times.
#[derive(Debug)]
pub(super) struct ColumnGroup {
    /// The times, s; `None` if rows have no time.
    times_s: Option<Vec<f64>>,
    /// The index of each column among those wanted, with its values.
    columns: Vec<(usize, Vec<f64>)>,
    rows: usize,
    next: usize,
}

impl ColumnGroup {
    /// Creates a group; the shortest column limits its rows.
    pub(super) fn new(times_s: Option<Vec<f64>>, columns: Vec<(usize, Vec<f64>)>) -> Self {
        let lengths = columns.iter().map(|(_, values)| values.len());
        let rows = lengths.chain(times_s.as_ref().map(Vec::len)).min().unwrap_or(0);
        ColumnGroup { times_s, columns, rows, next: 0 }
    }
}

/// The rows of several groups in the order of their times; rows with the same time are merged.
pub(super) struct Groups {
    wanted: Wanted,
    groups: Vec<ColumnGroup>,
    rows: u64,
    read: u64,
    place: u64,
}

impl Groups {
    /// Prepares groups for reading in time order.
    ///
    /// # Errors
    /// More than one group has values although no column has the time.
    pub(super) fn new(
        address: &str,
        wanted: &Wanted,
        mut groups: Vec<ColumnGroup>,
    ) -> Result<Self, SourceError> {
        groups.retain(|group| !group.columns.is_empty());
        if wanted.time.is_none() && groups.len() > 1 {
            let cause = "the columns have different times, so the map must name the time";
            return Err(SourceError::unreadable(address, cause));
        }
        let rows = groups.iter().map(|group| group.rows as u64).sum();
        Ok(Groups { wanted: wanted.clone(), groups, rows, read: 0, place: 0 })
    }

    /// The groups whose next row is the earliest, with its time. A missing time sorts first.
    fn earliest(&self) -> Option<(f64, Vec<usize>)> {
        let mut found: Option<(f64, Vec<usize>)> = None;
        for (index, group) in self.groups.iter().enumerate() {
            if group.next >= group.rows {
                continue;
            }
            let time_s = group.times_s.as_ref().map_or(f64::NAN, |times_s| times_s[group.next]);
            match &mut found {
                Some((first, all)) if *first == time_s => all.push(index),
                Some((first, _)) if first.is_nan() || time_s > *first => {}
                _ => found = Some((time_s, vec![index])),
            }
        }
        found
    }
}

impl Source for Groups {
    fn read(&mut self, row: &mut LogRow) -> Result<Read, SourceError> {
        let Some((time_s, groups)) = self.earliest() else { return Ok(Read::End) };
        self.place += 1;
        row.place = self.place;
        row.begin(self.wanted.names.len());
        for index in groups {
            let group = &mut self.groups[index];
            for (place, values) in &group.columns {
                let value = values[group.next];
                row.bad += u64::from(value.is_infinite());
                if value.is_finite() {
                    row.values[*place] = value;
                }
            }
            group.next += 1;
            self.read += 1;
        }
        let Some(time) = self.wanted.time else { return Ok(Read::Row) };
        row.values[time] = time_s;
        Ok(match time_s.is_finite() {
            true => Read::Row,
            false => Read::Flawed(Irregularity::NoTime.into()),
        })
    }

    fn counted(&self) -> &'static str {
        "row"
    }

    fn share(&self) -> Option<f64> {
        (self.rows > 0).then(|| self.read as f64 / self.rows as f64)
    }
}

/// `N` bytes from an offset, if present.
pub(super) fn bytes<const N: usize>(data: &[u8], at: usize) -> Option<[u8; N]> {
    data.get(at..at.checked_add(N)?)?.try_into().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn groups_of_two_rates_are_read_in_the_order_of_time() {
        let names = ["t", "fast", "slow"].map(String::from).to_vec();
        let wanted = Wanted { names, time: Some(0), ..Wanted::default() };
        let group = |times: &[f64], place, values: &[f64]| {
            ColumnGroup::new(Some(times.to_vec()), vec![(place, values.to_vec())])
        };
        let groups = vec![
            group(&[0.0, 1.0, 2.0, f64::NAN], 1, &[1.0, 2.0, 3.0, 4.0]),
            group(&[1.0, 1.5], 2, &[7.0, 8.0]),
        ];
        let mut source = Groups::new("log", &wanted, groups).unwrap();
        let (mut row, mut found) = (LogRow::default(), vec![]);
        loop {
            match source.read(&mut row).unwrap() {
                Read::End => break,
                Read::Row => found
                    .push(row.values.iter().map(|v| v.to_string()).collect::<Vec<_>>().join(" ")),
                other => found.push(format!("{other:?}")),
            }
        }
        let flaw = format!("{:?}", Read::Flawed(Irregularity::NoTime.into()));
        assert_eq!(found, ["0 1 NaN", "1 2 7", "1.5 NaN 8", "2 3 NaN", &flaw]);
        assert_eq!((source.share(), row.place), (Some(1.0), 5));
    }
}
