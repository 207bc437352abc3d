//! Reads `[reservoirs]`: which source and which tank share the fluid of one hydraulic system.

use super::{Reader, get, names, unknown_word};
use crate::document::{Entry, entries};
use crate::system::mistake::SystemMistake;
use crate::system::reservoir::{self, Reservoir};
use crate::system::scope::{Part, Scope};
use servotwin_model::network::PortOf;

impl Reader {
    pub(super) fn reservoir(&mut self, scope: &Scope, entry: &Entry) {
        self.good_name(entry.key, &entry.at);
        let Some(table) = self.table(entry) else { return };
        let all = entries(table);
        let place = format!("reservoir '{}'", entry.key);
        self.only(&all, &place, &["volume_m3", "supply", "return"]);
        let declared = &reservoir::VOLUME;
        let volume_m3 = match get(&all, declared.name) {
            Some(volume) => {
                let range = (declared.min, declared.max);
                self.within(volume, range, declared.unit, declared.summary)
            }
            None => {
                self.missing(&entry.at, &place, "volume_m3", "volume_m3 = 12e-3".into());
                None
            }
        };
        let source = self
            .member(scope, entry, (&place, "supply"), |reader, word| reader.source(scope, word));
        let tank = self.member(scope, entry, (&place, "return"), |_, word| tank(scope, word));
        let (Some(volume_m3), Some((supply, input)), Some(tank)) = (volume_m3, source, tank) else {
            return;
        };
        let id = entry.key.to_owned();
        self.reservoirs.push(Reservoir { id, volume_m3, supply, input, tank });
    }

    /// The component that a key of a reservoir names, found by `find`.
    fn member<T>(
        &mut self,
        scope: &Scope,
        reservoir: &Entry,
        (place, key): (&str, &'static str),
        find: impl Fn(&Self, &str) -> Result<T, SystemMistake>,
    ) -> Option<T> {
        let all = reservoir.table().map(entries).unwrap_or_default();
        let Some(entry) = get(&all, key) else {
            self.missing(&reservoir.at, place, key, format!("{key} = \"…\", a component's name"));
            return None;
        };
        let word = self.text(entry)?;
        // A component that could not be read is reported where it stands.
        if scope.is_broken(word) {
            return None;
        }
        let found = find(self, word);
        found.map_err(|mistake| self.mistakes.note(&entry.value_at(), mistake)).ok()
    }

    /// A source that no other reservoir feeds, with the input that gives its pressure.
    fn source(&self, scope: &Scope, word: &str) -> Result<(usize, usize), SystemMistake> {
        let is_free = |source: usize| self.reservoirs.iter().all(|taken| taken.supply != source);
        let free: Vec<_> =
            driven_sources(scope).into_iter().filter(|(_, (source, _))| is_free(*source)).collect();
        let found = free.iter().find(|(id, _)| id == word);
        found.map(|&(_, source)| source).ok_or_else(|| SystemMistake::NoSupply {
            word: word.into(),
            known: names(free.iter().map(|(id, _)| id.as_str())),
        })
    }
}

/// Pressure sources whose pressure is an input of the system, with component and input.
fn driven_sources(scope: &Scope) -> Vec<(String, (usize, usize))> {
    let driven_by = |component: usize, port: usize| {
        let port = PortOf { component, port };
        scope.inputs.iter().position(|input| input.targets.iter().any(|end| end.port == port))
    };
    let parts = scope.parts.iter().enumerate().filter(|(_, p)| p.spec().kind == "pressure_source");
    let source = |(component, part): (usize, &Part)| {
        let port = part.spec().ports.iter().position(|port| port.name == "pressure")?;
        Some((part.id.clone(), (component, driven_by(component, port)?)))
    };
    parts.filter_map(source).collect()
}

fn tank(scope: &Scope, word: &str) -> Result<usize, SystemMistake> {
    let tanks = || scope.parts.iter().enumerate().filter(|(_, part)| part.spec().kind == "tank");
    let found = tanks().find(|(_, part)| part.id == word).map(|(component, _)| component);
    found
        .ok_or_else(|| unknown_word("tank", word, names(tanks().map(|(_, part)| part.id.as_str()))))
}
