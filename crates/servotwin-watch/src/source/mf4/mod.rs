//! Reads MDF 4 files (`.mf4`) of measurement systems, whose channel groups have separate rates.
//!
//! The reader supports groups whose master channel is a time, with channels of fixed length. It reads integers and
//! floats, linear, rational and tabulated conversions, invalidation bits, data in lists and zipped blocks. The column
//! `time` is the master of every group, in seconds. Everything else is rejected by name or skipped. The reader follows
//! the published layout of ASAM MDF 4.1; every address and length is checked against the file.

mod blocks;
mod values;

use super::groups::{ColumnGroup, Groups};
use super::{LogColumn, Source, SourceError, Wanted};
use blocks::{Channel, ChannelGroup, Mdf};
use servotwin::units;
use std::path::Path;

/// The column with the times of all groups, s.
const TIME: &str = "time";

/// The most values of all wanted columns that are read (1 GiB).
const MAX_VALUES: u64 = 1 << 27;

/// Opens a file that must have the wanted columns.
///
/// # Errors
/// The file cannot be read, is damaged or lacks a column, or a wanted column has an unsupported type.
pub(crate) fn open(path: &Path, wanted: &Wanted) -> Result<Box<dyn Source>, SourceError> {
    let address = path.display().to_string();
    let mut file = Mdf::open(path)?;
    let known = named(&file);
    let names: Vec<String> = known.iter().map(|(name, ..)| name.clone()).collect();
    let all: Vec<String> = std::iter::once(TIME.to_owned()).chain(names).collect();
    wanted.require(&address, &all)?;
    if let Some(time) = wanted.time.filter(|&time| wanted.names[time] != TIME) {
        let name = servotwin_io::sanitize::text(&wanted.names[time]);
        let cause = format!("the times are the column '{TIME}', not '{name}'");
        return Err(SourceError::unreadable(&address, &cause));
    }
    // For each group, the row index and the channel of its wanted columns.
    let mut chosen: Vec<Vec<(usize, usize)>> = vec![vec![]; file.groups.len()];
    for (place, name) in wanted.names.iter().enumerate() {
        if let Some((_, group, channel)) = known.iter().find(|(known, ..)| known == name) {
            chosen[*group].push((place, *channel));
        }
    }
    let unreadable = |cause: String| SourceError::unreadable(&address, &cause);
    let mut total = 0_u64;
    let mut groups = vec![];
    for (index, chosen) in chosen.into_iter().enumerate().filter(|(_, chosen)| !chosen.is_empty()) {
        total = total
            .saturating_add(file.groups[index].records.saturating_mul(1 + chosen.len() as u64));
        if total > MAX_VALUES {
            return Err(unreadable(format!(
                "more than {MAX_VALUES} values are wanted; cut the file, or map fewer columns"
            )));
        }
        groups.push(read_group(&mut file, index, &chosen).map_err(unreadable)?);
    }
    Ok(Box::new(Groups::new(&address, wanted, groups)?))
}

/// The columns of a file with their units.
///
/// # Errors
/// It cannot be read or is damaged.
pub(crate) fn columns(path: &Path) -> Result<Vec<LogColumn>, SourceError> {
    let file = Mdf::open(path)?;
    let mut found = vec![LogColumn::in_unit(TIME, "s")];
    let known = named(&file).into_iter();
    found.extend(known.map(|(name, group, channel)| {
        let unit = &file.groups[group].channels[channel].unit;
        LogColumn::in_unit(name, unit)
    }));
    Ok(found)
}

/// The channels by column name, with group and index. A name that occurs in several groups gets the number of its
/// group: `p#1` and `p#2`.
fn named(file: &Mdf) -> Vec<(String, usize, usize)> {
    let mut count = std::collections::BTreeMap::<&str, usize>::new();
    let groups = || file.groups.iter().enumerate().filter(|(_, group)| group.master.is_some());
    let channels = |group: &'_ ChannelGroup| {
        let master = group.master;
        (0..group.channels.len()).filter(move |&channel| Some(channel) != master)
    };
    for (_, group) in groups() {
        for channel in channels(group) {
            *count.entry(&group.channels[channel].name).or_default() += 1;
        }
    }
    let mut found = vec![];
    for (index, group) in groups() {
        for channel in channels(group) {
            let name = &group.channels[channel].name;
            let is_alone = count[name.as_str()] == 1 && name != TIME;
            let name = if is_alone { name.clone() } else { format!("{name}#{}", index + 1) };
            found.push((name, index, channel));
        }
    }
    found
}

/// Reads the times and the chosen channels of a group.
fn read_group(
    file: &mut Mdf,
    index: usize,
    chosen: &[(usize, usize)],
) -> Result<ColumnGroup, String> {
    let group = file.groups[index].clone();
    let Some(master) = group.master else { return Err("a group has no time".into()) };
    let channels: Vec<&Channel> = std::iter::once(&group.channels[master])
        .chain(chosen.iter().map(|&(_, channel)| &group.channels[channel]))
        .collect();
    let mut decoders = vec![];
    for channel in &channels {
        let named =
            |cause| format!("column '{}': {cause}", servotwin_io::sanitize::text(&channel.name));
        decoders.push(values::Decoder::new(file, &group, channel).map_err(named)?);
    }
    let mut columns = vec![vec![]; decoders.len()];
    let mut number = 0;
    file.records(&group, &mut |record| {
        for (decoder, column) in decoders.iter().zip(&mut columns) {
            column.push(decoder.value(record, number));
        }
        number += 1;
    })?;
    let unit = &group.channels[master].unit;
    let second = units::find(unit).and_then(|row| row.to(servotwin_model::spec::Unit::Second));
    let seconds = second.map_or(1.0, |(factor, _)| factor);
    let mut columns = columns.into_iter();
    let times = columns.next().unwrap_or_default();
    // A factor of one preserves the bits.
    let times_s: Vec<f64> = times.into_iter().map(|time| time * seconds).collect();
    let columns = chosen.iter().map(|&(place, _)| place).zip(columns).collect();
    Ok(ColumnGroup::new(Some(times_s), columns))
}
