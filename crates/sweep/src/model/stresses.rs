//! Components of the stress by their causes: name, meaning and place of each, declared once.
//!
//! The columns of samples and results in the store, averages, tables, exports and the page all go by this list.

use sd_core::{Sample, StressComponents};

/// One component of the stress, or one part of it, in mu·rate.
#[derive(Debug, Clone, Copy)]
pub(crate) struct StressColumn {
    /// Its name in the store, in tables and in JSON.
    pub(crate) name: &'static str,
    /// What it is; also its label on the page.
    pub(crate) meaning: &'static str,
    /// Where it comes from.
    source: Source,
}

/// Where a number comes from.
#[derive(Debug, Clone, Copy)]
enum Source {
    /// The sum of its parts.
    Total(fn(&StressComponents) -> f64),
    /// One part, which is kept in every sample.
    Part(fn(&mut StressComponents) -> &mut f64),
}

impl StressColumn {
    /// Its value in a sample; not a number in samples of programs that did not measure it.
    pub(crate) fn read(&self, sample: &Sample) -> f64 {
        let mut components = sample.stress;
        match self.source {
            Source::Total(total) => total(&components),
            Source::Part(part) => *part(&mut components),
        }
    }

    /// Whether it is one part of a component.
    pub(crate) fn is_part(&self) -> bool {
        matches!(self.source, Source::Part(_))
    }
}

/// A component as the sum of its parts.
const fn total(
    name: &'static str,
    meaning: &'static str,
    total: fn(&StressComponents) -> f64,
) -> StressColumn {
    StressColumn {
        name,
        meaning,
        source: Source::Total(total),
    }
}

/// A part of a component.
const fn part(
    name: &'static str,
    meaning: &'static str,
    part: fn(&mut StressComponents) -> &mut f64,
) -> StressColumn {
    StressColumn {
        name,
        meaning,
        source: Source::Part(part),
    }
}

/// How many there are.
pub(crate) const COUNT: usize = 17;

/// All of them, in the order of the columns.
#[rustfmt::skip]
pub(crate) static STRESSES: [StressColumn; COUNT] = [
    total("n1", "first normal stress difference N₁, contacts included", |s| s.n1.total()),
    total("n2", "second normal stress difference N₂, contacts included", |s| s.n2.total()),
    total("particle_pressure", "particle pressure Π of contacts and repulsion, without its hydrodynamic part", |s| s.particle_pressure.total()),
    part("shear_hydrodynamic", "shear stress of the stresslets", |s| &mut s.shear.hydrodynamic),
    part("shear_normal_contact", "shear stress of the normal contact forces", |s| &mut s.shear.normal_contact),
    part("shear_tangential_contact", "shear stress of the tangential contact forces", |s| &mut s.shear.tangential_contact),
    part("shear_repulsion", "shear stress of the repulsion", |s| &mut s.shear.repulsion),
    part("n1_hydrodynamic", "N₁ of the stresslets", |s| &mut s.n1.hydrodynamic),
    part("n1_normal_contact", "N₁ of the normal contact forces", |s| &mut s.n1.normal_contact),
    part("n1_tangential_contact", "N₁ of the tangential contact forces", |s| &mut s.n1.tangential_contact),
    part("n1_repulsion", "N₁ of the repulsion", |s| &mut s.n1.repulsion),
    part("n2_hydrodynamic", "N₂ of the stresslets", |s| &mut s.n2.hydrodynamic),
    part("n2_normal_contact", "N₂ of the normal contact forces", |s| &mut s.n2.normal_contact),
    part("n2_tangential_contact", "N₂ of the tangential contact forces", |s| &mut s.n2.tangential_contact),
    part("n2_repulsion", "N₂ of the repulsion", |s| &mut s.n2.repulsion),
    part("particle_pressure_normal_contact", "particle pressure of the normal contact forces", |s| &mut s.particle_pressure.normal_contact),
    part("particle_pressure_repulsion", "particle pressure of the repulsion", |s| &mut s.particle_pressure.repulsion),
];

/// Those that every sample keeps, in the order of their columns.
pub(crate) fn parts() -> impl Iterator<Item = &'static StressColumn> {
    STRESSES.iter().filter(|column| column.is_part())
}

/// The components whose parts are these, in the order of [`parts`].
pub(crate) fn of_parts(values: impl IntoIterator<Item = f64>) -> StressComponents {
    let mut components = StressComponents::default();
    for (column, value) in parts().zip(values) {
        if let Source::Part(place) = column.source {
            *place(&mut components) = value;
        }
    }
    components
}

/// Names with something before each, as in a list of a statement.
pub(crate) fn names(columns: impl Iterator<Item = &'static StressColumn>, before: &str) -> String {
    let names: Vec<String> = columns
        .map(|column| format!("{before}{}", column.name))
        .collect();
    names.join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_support::sample;

    #[test]
    fn parts_come_back_and_add_up_to_what_they_are_parts_of() {
        let numbers: Vec<f64> = (1..=parts().count()).map(|n| n as f64).collect();
        let stress = of_parts(numbers.iter().copied());
        let sample = Sample {
            stress,
            ..sample(0.0)
        };
        let read: Vec<f64> = parts().map(|column| column.read(&sample)).collect();
        assert_eq!(read, numbers);
        for column in STRESSES.iter().filter(|column| !column.is_part()) {
            let begins = format!("{}_", column.name);
            let of_it = parts().filter(|part| part.name.starts_with(&begins));
            let sum: f64 = of_it.map(|part| part.read(&sample)).sum();
            assert_eq!(column.read(&sample), sum, "{}", column.name);
        }
        let mut names: Vec<&str> = STRESSES.iter().map(|column| column.name).collect();
        names.sort_unstable();
        names.dedup();
        assert_eq!(names.len(), COUNT);
    }
}
