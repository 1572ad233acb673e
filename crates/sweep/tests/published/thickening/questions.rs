//! What is asked of the design: sums and differences of the rises of its models.

/// Which viscosity.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Counted {
    /// With the stress that contacts bear.
    All,
    /// Stresslets alone, as eq. (20) of the paper has it.
    Stresslets,
    /// The ratio of the first to the second: what the contact stress makes.
    Ratio,
}

/// A model at one place of the design.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Model {
    pub(super) hydrodynamics: &'static str,
    /// Infinite for rigid contacts.
    pub(super) stiffness: f64,
    /// Whether friction sticks: coulomb on rigid contacts, stick-slide on springs.
    pub(super) sticks: bool,
}

pub(super) const RIGID: f64 = f64::INFINITY;

/// With Ball-Melrose hydrodynamics.
const fn with(stiffness: f64, sticks: bool) -> Model {
    Model {
        hydrodynamics: "ball-melrose",
        stiffness,
        sticks,
    }
}

/// A normal law in words.
fn normal(stiffness: f64) -> String {
    if stiffness.is_infinite() {
        "rigid".to_owned()
    } else {
        format!("k = 1e{}", stiffness.log10().round())
    }
}

impl Model {
    const fn under(self, hydrodynamics: &'static str) -> Self {
        Self {
            hydrodynamics,
            ..self
        }
    }

    /// The friction law, in the word of the campaign file.
    pub(super) fn tangential(self) -> &'static str {
        match (self.sticks, self.stiffness.is_infinite()) {
            (false, _) => "roll-slip",
            (true, true) => "coulomb",
            (true, false) => "stick-slide",
        }
    }

    /// In words.
    fn words(self) -> String {
        let hydrodynamics = match self.hydrodynamics {
            "ball-melrose" => "",
            "lubrication" => ", lubrication alone",
            _ => ", full",
        };
        let normal = normal(self.stiffness);
        format!("{normal}, {}{hydrodynamics}", self.tangential())
    }
}

/// A sum over models: how often each counts.
pub(super) type Sum = Vec<(f64, Model)>;

/// One model less another.
fn less(with: Model, without: Model) -> Sum {
    vec![(1.0, with), (-1.0, without)]
}

/// The mean of sums.
fn mean(sums: &[Sum]) -> Sum {
    let share = 1.0 / sums.len() as f64;
    let all = sums.iter().flatten();
    all.map(|(weight, model)| (share * weight, *model))
        .collect()
}

/// One sum less another.
fn difference(one: Sum, other: &[(f64, Model)]) -> Sum {
    let other = other.iter().map(|(weight, model)| (-weight, *model));
    one.into_iter().chain(other).collect()
}

/// What is told of a choice.
pub(super) struct Question {
    pub(super) kind: &'static str,
    pub(super) choice: String,
    pub(super) sum: Sum,
    pub(super) counted: Counted,
}

impl Question {
    fn new(kind: &'static str, choice: impl Into<String>, sum: Sum, counted: Counted) -> Self {
        Self {
            kind,
            choice: choice.into(),
            sum,
            counted,
        }
    }
}

const SPRINGS: [f64; 3] = [1e5, 1e4, 1e3];
const LUBRICATION: &str = "lubrication";
pub(super) const FULL: &str = "stokesian-dynamics";

/// All normal laws.
fn normals() -> impl Iterator<Item = f64> {
    std::iter::once(RIGID).chain(SPRINGS)
}

/// A model alone.
fn alone(model: Model) -> Sum {
    vec![(1.0, model)]
}

/// What friction that sticks makes, under Ball-Melrose.
fn sticking(stiffness: f64) -> Sum {
    less(with(stiffness, true), with(stiffness, false))
}

/// The rise of every model that was run.
fn rises() -> Vec<Question> {
    let rise = |model: Model| Question::new("rise", model.words(), alone(model), Counted::All);
    let first = Question::new(
        "rise",
        "rigid, roll-slip, stresslets alone",
        alone(with(RIGID, false)),
        Counted::Stresslets,
    );
    let mut all = vec![first];
    for sticks in [false, true] {
        all.extend(normals().map(|stiffness| rise(with(stiffness, sticks))));
    }
    for hydrodynamics in [LUBRICATION, FULL] {
        let models = [
            with(RIGID, false),
            with(RIGID, true),
            with(1e4, false),
            with(1e4, true),
        ];
        all.extend(models.map(|model| rise(model.under(hydrodynamics))));
    }
    all
}

/// From the paper's reading of its model to the model of the field, one choice after the other: these add up.
fn steps() -> Vec<Question> {
    let paper = with(RIGID, false);
    let field = with(1e4, true).under(LUBRICATION);
    [
        (
            "the paper: rigid, roll-slip, stresslets alone",
            alone(paper),
            Counted::Stresslets,
        ),
        ("+ contact stress counted", alone(paper), Counted::Ratio),
        (
            "+ springs of k = 1e5",
            less(with(1e5, false), paper),
            Counted::All,
        ),
        ("+ friction that sticks", sticking(1e5), Counted::All),
        (
            "+ softer, k = 1e4",
            less(with(1e4, true), with(1e5, true)),
            Counted::All,
        ),
        (
            "+ lubrication alone",
            less(field, with(1e4, true)),
            Counted::All,
        ),
        ("= the field's model", alone(field), Counted::All),
    ]
    .map(|(choice, sum, counted)| Question::new("step", choice, sum, counted))
    .into()
}

/// What each choice makes, averaged over the others.
fn main_effects() -> Vec<Question> {
    let seven = normals().map(|stiffness| with(stiffness, false));
    let seven = seven.chain(SPRINGS.map(|stiffness| with(stiffness, true)));
    let seven: Vec<Sum> = seven.map(alone).collect();
    let three = [with(RIGID, false), with(1e4, false), with(1e4, true)];
    let under = |hydrodynamics| mean(&three.map(|model| less(model.under(hydrodynamics), model)));
    let softer = |stiffness: f64| {
        mean(&[false, true].map(|sticks| less(with(stiffness, sticks), with(1e5, sticks))))
    };
    let nearly_rigid = |sticks| less(with(1e5, sticks), with(RIGID, sticks));
    let counted = Question::new(
        "main",
        "contact stress counted",
        mean(&seven),
        Counted::Ratio,
    );
    let others = [
        ("friction that sticks", mean(&SPRINGS.map(sticking))),
        (
            "springs of k = 1e5 in place of rigid contacts (roll-slip)",
            nearly_rigid(false),
        ),
        (
            "springs of k = 1e5 in place of rigid contacts (sticking)",
            nearly_rigid(true),
        ),
        ("k = 1e4 in place of 1e5", softer(1e4)),
        ("k = 1e3 in place of 1e5", softer(1e3)),
        (
            "lubrication alone in place of Ball-Melrose",
            under(LUBRICATION),
        ),
        ("full in place of Ball-Melrose", under(FULL)),
    ]
    .map(|(choice, sum)| Question::new("main", choice, sum, Counted::All));
    std::iter::once(counted).chain(others).collect()
}

/// What a choice makes where another is made as well, or how much more it makes there.
fn pairs() -> Vec<Question> {
    let pair = |choice: String, sum, counted| Question::new("pair", choice, sum, counted);
    let mut all = Vec::new();
    for stiffness in normals() {
        let model = with(stiffness, false);
        let choice = format!("contact stress counted, {}", model.words());
        all.push(pair(choice, alone(model), Counted::Ratio));
    }
    for stiffness in normals() {
        let choice = format!("friction that sticks, {}", normal(stiffness));
        all.push(pair(choice, sticking(stiffness), Counted::All));
    }
    all.push(pair(
        "friction that sticks, on stresslets alone (k = 1e5)".into(),
        sticking(1e5),
        Counted::Stresslets,
    ));
    all.push(pair(
        "friction that sticks, more at k = 1e5 than at 1e3".into(),
        difference(sticking(1e5), &sticking(1e3)),
        Counted::All,
    ));
    for (hydrodynamics, words) in [(LUBRICATION, "lubrication alone"), (FULL, "full")] {
        let there = |model: Model| model.under(hydrodynamics);
        let sticking_there = less(there(with(1e4, true)), there(with(1e4, false)));
        all.push(pair(
            format!("friction that sticks, more under {words} than Ball-Melrose (k = 1e4)"),
            difference(sticking_there, &sticking(1e4)),
            Counted::All,
        ));
        let softer_there = less(there(with(1e4, false)), there(with(RIGID, false)));
        all.push(pair(
            format!("k = 1e4 in place of rigid, more under {words} than Ball-Melrose (roll-slip)"),
            difference(softer_there, &less(with(1e4, false), with(RIGID, false))),
            Counted::All,
        ));
    }
    all
}

/// All that is asked, at every area fraction and friction at which there are runs for it.
pub(super) fn questions() -> Vec<Question> {
    [rises(), steps(), main_effects(), pairs()]
        .into_iter()
        .flatten()
        .collect()
}
