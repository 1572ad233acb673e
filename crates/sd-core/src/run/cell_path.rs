//! The lattice of a run whose flow is not simple shear throughout.
//!
//! One lattice recurs in one type of flow. A run has that of its own flow: the type for which the
//! shortest vector of the whole run is longest. In segments of another type before and after, the
//! lattice is carried along, which few lattices survive for long.

use crate::error::Error;
use crate::model::{FlowType, Hydrodynamics, Params};
use crate::space::cell::{Cell, Lattice};
use crate::space::lattice::RecurrentLattice;
use crate::space::{Space, VelocityGradient};

/// Strain between the lattices whose shortest vectors are compared.
const STRIDE: f64 = 0.02;
/// Strain for which a last segment is followed, whose length is no part of the parameters.
const FOLLOWED: f64 = 5.0;

/// The lattice at one place of a run.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Place<S: Space> {
    /// In a flow of the own type, after a net strain, and a strain across it.
    Own([f64; 2]),
    /// Elsewhere.
    Other(Lattice<S>),
}

/// The lattice in the flow of its own type.
#[derive(Debug, Clone, PartialEq)]
enum Own<S: Space> {
    /// A sheared cell of this side.
    Sheared(f64),
    Recurrent(Box<RecurrentLattice<S>>),
}

/// The lattice of a run, at the start of a segment of it.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct CellPath<S: Space> {
    own_flow: FlowType,
    own: Own<S>,
    /// The number of the first segment of the own type.
    first: usize,
    /// The segment, its flow, and the lattice at its start.
    segment: usize,
    flow: FlowType,
    start: Place<S>,
}

impl<S: Space> CellPath<S> {
    /// The path of a run with a cell of this side, or with a lattice of the same content; `None` if
    /// it is sheared throughout.
    ///
    /// # Errors
    /// Those of [`Cell::periodic`].
    pub(crate) fn new(run: &Params, side: f64) -> Result<Option<Self>, Error> {
        Ok(Self::best(run, side)?.map(|(path, _)| path))
    }

    /// The path of a run with a cell of this side; under an imposed pressure, which changes the
    /// side, that of a lattice of content 1.
    ///
    /// # Errors
    /// Those of [`Cell::periodic`].
    pub(crate) fn of_run(run: &Params, side: f64) -> Result<Option<Self>, Error> {
        Self::new(run, if run.imposes_pressure() { 1.0 } else { side })
    }

    /// The shortest vector of the run's lattices at any strain, in a; `None` if it is sheared
    /// throughout.
    ///
    /// # Errors
    /// Those of [`Cell::periodic`].
    pub(crate) fn shortest(run: &Params, side: f64) -> Result<Option<f64>, Error> {
        Ok(Self::best(run, side)?.map(|(_, shortest)| shortest))
    }

    /// Whether a run has the lattices of a shorter one, whose segments are its first, until that
    /// ends, and a far field that is planned for the same cell.
    ///
    /// # Errors
    /// Those of [`Cell::periodic`].
    pub(crate) fn begins_like(run: &Params, shorter: &Params, side: f64) -> Result<bool, Error> {
        let [whole, begun] = [Self::best(run, side)?, Self::best(shorter, side)?];
        if run.hydrodynamics == Hydrodynamics::StokesianDynamics {
            return Ok(whole == begun);
        }
        Ok(whole.map(|(path, _)| path) == begun.map(|(path, _)| path))
    }

    /// The path with the longest shortest vector, at the start of the run, and its length.
    fn best(run: &Params, side: f64) -> Result<Option<(Self, f64)>, Error> {
        if run.is_sheared() {
            return Ok(None);
        }
        let mut best: Option<(Self, f64)> = None;
        let flows = run.flow_types();
        for (first, flow) in flows.iter().enumerate() {
            if flows[..first].contains(flow) {
                continue;
            }
            let path = Self::of(run, side, *flow, first)?;
            let shortest = path.clone().followed(run)?;
            if best.as_ref().is_none_or(|(_, longest)| shortest > *longest) {
                best = Some((path, shortest));
            }
        }
        Ok(best)
    }

    /// The path with the lattice of a type of flow, which begins in that segment.
    fn of(run: &Params, side: f64, flow: FlowType, first: usize) -> Result<Self, Error> {
        let content = (0..S::DIMENSIONS).map(|_| side).product();
        let mut path = Self {
            own_flow: flow,
            own: match flow {
                FlowType::Shear => Own::Sheared(side),
                other => Own::Recurrent(Box::new(RecurrentLattice::new(other, content))),
            },
            first,
            segment: 0,
            flow,
            start: Place::Own([0.0; 2]),
        };
        path.enter(run, 0)?;
        Ok(path)
    }

    /// Moves to the start of a segment of the run.
    ///
    /// # Errors
    /// Those of [`Cell::periodic`].
    pub(crate) fn enter(&mut self, run: &Params, segment: usize) -> Result<(), Error> {
        let before = run.displacements_before(segment.max(self.first));
        let mut place = Place::Own([0.0; 2]);
        for one in before[segment.min(self.first)..self.first].iter().rev() {
            place = self.moved(place, one.flow, [-one.strain, -one.cross])?;
        }
        for one in &before[self.first..] {
            place = self.moved(place, one.flow, [one.strain, one.cross])?;
        }
        self.segment = segment;
        self.flow = run.flow_types()[segment];
        self.start = place;
        Ok(())
    }

    /// Whether the lattice recurs in the present segment.
    pub(crate) fn recurs(&self) -> bool {
        matches!(self.start, Place::Own(_)) && self.flow == self.own_flow
    }

    /// Whether the path is at that segment.
    pub(crate) fn is_in(&self, segment: usize) -> bool {
        self.segment == segment
    }

    /// The cell after a net strain, and a cross strain, in the present segment.
    ///
    /// # Errors
    /// Those of [`Cell::periodic`].
    pub(crate) fn at(&self, strain: f64, cross: f64) -> Result<Cell<S>, Error> {
        let place = self.moved(self.start, self.flow, [strain, cross])?;
        Ok(Cell::Periodic(self.lattice(place)?))
    }

    fn lattice(&self, place: Place<S>) -> Result<Lattice<S>, Error> {
        match (place, &self.own) {
            (Place::Other(lattice), _) => Ok(lattice),
            (Place::Own([strain, _]), Own::Recurrent(recurrent)) => Ok(recurrent.at(strain)),
            (Place::Own([strain, cross]), Own::Sheared(side)) => {
                let cell = Cell::equal_sides(*side, strain * side)?;
                let cell = cell.with_cross_offset(cross * side)?;
                let lattice = cell.lattice().expect("a periodic cell");
                Ok(*lattice)
            }
        }
    }

    /// The lattice after a flow of a type for a net strain and a cross strain.
    fn moved(
        &self,
        place: Place<S>,
        flow: FlowType,
        [strain, cross]: [f64; 2],
    ) -> Result<Place<S>, Error> {
        if let Place::Own([before, crossed]) = place
            && flow == self.own_flow
        {
            return Ok(Place::Own([before + strain, crossed + cross]));
        }
        let gradient = VelocityGradient::of_type(flow, strain).with_cross_shear(cross);
        Ok(Place::Other(self.lattice(place)?.deform(&gradient, 1.0)))
    }

    /// The shortest vector of all lattices of the run.
    fn followed(mut self, run: &Params) -> Result<f64, Error> {
        let flows = run.flow_types();
        let mut shortest = self.lattice(Place::Own([0.0; 2]))?.shortest();
        let mut strains: Vec<[f64; 2]> = run
            .displacements_before(flows.len() - 1)
            .iter()
            .map(|one| [one.strain, one.cross])
            .collect();
        let last = run.segments.last().and_then(|last| last.direction);
        strains.push([FOLLOWED * last.unwrap_or(run.direction), 0.0]);
        for (segment, [strain, cross]) in strains.into_iter().enumerate() {
            self.enter(run, segment)?;
            if self.recurs() {
                continue;
            }
            let strides = (strain.abs() / STRIDE).ceil().max(1.0);
            let mut passed = 0.0;
            while passed <= strides {
                let share = passed / strides;
                let cell = self.at(share * strain, share * cross)?;
                let lattice = cell.lattice().expect("a periodic cell");
                shortest = shortest.min(lattice.shortest());
                passed += 1.0;
            }
        }
        Ok(shortest)
    }
}

/// A cell for which the far field of a run is planned: with the content of its lattices, and as
/// narrow as their shortest vector.
///
/// # Errors
/// Those of [`Cell::periodic`].
pub(crate) fn planned_cell<S: Space>(run: &Params, side: f64) -> Result<Cell<S>, Error> {
    let Some(shortest) = CellPath::<S>::shortest(run, side)? else {
        return Cell::equal_sides(side, 0.0);
    };
    let mut sides = S::Vector::default();
    sides[0] = shortest;
    for k in 1..S::DIMENSIONS {
        sides[k] = if S::DIMENSIONS < 3 {
            side * (side / shortest)
        } else {
            side * (side / shortest).sqrt()
        };
    }
    Cell::periodic(sides, 0.0)
}
