//! The runs of a campaign as a table.

use super::*;
use crate::data::Kind;
use crate::data::{Cells, DataColumn};
use crate::model::axes::AXES;

/// The column of this name.
fn column<'t>(table: &'t [DataColumn], name: &str) -> &'t Cells {
    &table
        .iter()
        .find(|column| column.name == name)
        .unwrap()
        .cells
}

#[test]
fn runs_of_every_state_have_all_axes_and_results() {
    let directory = tempfile::tempdir().unwrap();
    let mut store = open(directory.path());
    store.register(1).unwrap();
    let claim = store.next().unwrap();
    store.end(&claim, &finished(State::Done)).unwrap();
    let table = store.runs().unwrap();
    assert!(table.iter().all(|column| column.cells.len() == 4));
    for axis in AXES.iter() {
        let kind = match column(&table, axis.key) {
            Cells::Word(_) => Kind::Word,
            Cells::Count(_) => Kind::Count,
            Cells::Number(_) => Kind::Number,
        };
        assert_eq!(kind, axis.kind(), "{}", axis.key);
    }
    let Cells::Word(states) = column(&table, "state") else {
        panic!("states are words");
    };
    let done: Vec<usize> = (0..4)
        .filter(|row| states[*row].as_deref() == Some("done"))
        .collect();
    assert_eq!(done.len(), 1);
    let Cells::Number(viscosities) = column(&table, "viscosity") else {
        panic!("viscosities are numbers");
    };
    // As another program reads it: our own connections use no views.
    let of_view: f64 = rusqlite::Connection::open(store.path())
        .unwrap()
        .query_row(
            "SELECT viscosity FROM runs WHERE state = 'done'",
            [],
            |row| row.get(0),
        )
        .unwrap();
    assert_eq!(viscosities[done[0]], Some(of_view));
    assert_eq!(viscosities.iter().flatten().count(), 1);
    let Cells::Number(rates) = column(&table, "shear_rate") else {
        panic!("shear rates are numbers");
    };
    assert_eq!(rates[2], Some(f64::INFINITY));
}
