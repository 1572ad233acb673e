use super::*;
use crate::test_support::params;
use sd_core::ContactLaws;
use sd_core::model::{Number, Quantity, Range};

/// A further axis, added to the table by this one entry: the fraction of small spheres.
pub(super) static ONE_MORE: [Parameter; 1] = [Parameter {
    key: "small_fraction",
    unit: "1",
    meaning: "small spheres over all",
    has_meaning: |p| p.size_ratio > 1.0,
    needs: Some(|| "`size_ratio` above 1".into()),
    form: Form::Number(Number {
        quantity: &SMALL_FRACTION,
        whole: false,
        default: Some(|p| 1.0 - p.large_fraction),
        get: |p| 1.0 - p.large_fraction,
        set: |p, value| {
            // An unchanged value keeps its last digits.
            if value != 1.0 - p.large_fraction {
                p.large_fraction = 1.0 - value;
            }
        },
        without: None,
        stays: false,
        is_of_laws: false,
    }),
}];

static SMALL_FRACTION: Quantity = Quantity {
    key: "small_fraction",
    unit: "1",
    meaning: "small spheres over all",
    range: Range::from_to(0.0, 1.0),
    note: "",
};

/// The fields of a type, also those that are omitted at their default, as its reader names them.
fn fields<T: serde::de::DeserializeOwned + std::fmt::Debug>() -> Vec<String> {
    let error = serde_json::from_str::<T>(r#"{"nothing":0}"#).unwrap_err();
    let error = error.to_string();
    assert!(error.contains("expected one of `"), "{error}");
    let names = error.split('`').skip(3).step_by(2);
    names.map(str::to_owned).collect()
}

#[test]
fn axes_have_the_names_that_files_have() {
    for key in ["viscous_number", "macroscopic_friction", "pressure"] {
        assert_eq!(Axis::named(key).unwrap().key, format!("imposed_{key}"));
    }
}

#[test]
fn every_parameter_is_an_axis() {
    // Points that differ in a parameter that is no axis would be averaged together.
    for key in [fields::<Params>(), fields::<ContactLaws>()].concat() {
        let key = match key.as_str() {
            "normal" => "contact",
            "onset" => "friction_onset",
            // The key of files is also the column of what is measured.
            "viscous_number" => "imposed_viscous_number",
            "macroscopic_friction" => "imposed_macroscopic_friction",
            "pressure" => "imposed_pressure",
            // Of the protocol, and of the library alone: every campaign shears.
            "segments" | "at_rest" => continue,
            same => same,
        };
        assert!(Axis::of_key(key).is_some(), "{key}");
    }
}

#[test]
fn written_values_make_parameters_that_have_them() {
    let mixture = Params {
        size_ratio: 1.4,
        large_fraction: 0.25,
        ..params()
    };
    let values: Vec<Option<Value>> = AXES.iter().map(|axis| Some(axis.value(&mixture))).collect();
    assert_eq!(params_of(&values).unwrap(), mixture);
    let nothing = vec![None; AXES.len()];
    let Err(InvalidCombination::Missing(missing)) = params_of(&nothing) else {
        panic!("something must be written");
    };
    let keys: Vec<&str> = missing.iter().map(|axis| axis.key).collect();
    assert_eq!(
        keys,
        [
            "spheres",
            "area_fraction",
            "roughness",
            "friction",
            "shear_rate"
        ]
    );
}

#[test]
fn without_friction_its_laws_and_the_rate_stay_as_they_are_written() {
    let word = |word| Some(Value::Word(word));
    let number = |number| Some(Value::Number(number));
    let values = |friction: f64, rate: f64, tangential| -> Vec<Option<Value>> {
        let value = |axis: &Axis| match axis.key {
            "spheres" => Some(Value::Count(60)),
            "area_fraction" => number(0.6),
            "roughness" => number(0.0),
            "friction" => number(friction),
            "shear_rate" => number(rate),
            "hydrodynamics" => word("lubrication"),
            "contact" => word("linear-spring"),
            "stiffness" => number(1e4),
            "stiffness_unit" => word("flow"),
            "tangential" => word(tangential),
            "friction_onset" => word("reduced"),
            _ => None,
        };
        AXES.iter().map(value).collect()
    };
    for tangential in ["roll-slip", "coulomb", "stick-slide"] {
        let (acting, None) = folded_params_of(&values(0.5, 10.0, tangential), &[]).unwrap() else {
            panic!("friction acts");
        };
        for (friction, rate) in [(0.0, 10.0), (0.5, 0.0), (0.0, 0.0)] {
            let (params, given) =
                folded_params_of(&values(friction, rate, tangential), &[]).unwrap();
            assert_eq!((params.friction, params.shear_rate), (0.0, 0.0));
            assert_eq!(
                params.contact.laws().tangential,
                ContactLaws::PAPER.tangential
            );
            let given = given.unwrap();
            let expected = Params {
                friction,
                shear_rate: rate,
                ..acting.clone()
            };
            assert_eq!(given, expected);
            let mut settled = given;
            settled.canonicalise();
            assert_eq!(settled, params);
        }
    }
    // "none" is friction of 0 by another word.
    let (params, given) = folded_params_of(&values(0.5, 10.0, "none"), &[]).unwrap();
    let given = given.unwrap();
    assert_eq!((given.friction, given.shear_rate), (0.0, 10.0));
    assert_eq!(params.shear_rate, 0.0);
}

/// One entry adds an axis everywhere: see [`ONE_MORE`].
mod one_more {
    use crate::model::campaign::Campaign;
    use crate::report::{
        PageHost, Report, Selection, Shape, data, point_table, write_json, write_text,
    };
    use crate::store::Store;

    const FILE: &str = r#"name = "one-more"
[protocol]
strain = 0.1
discard = 0.0
[[grid]]
area_fraction = 0.6
friction = 0.3
roughness = 0.01
shear_rate = 1
size_ratio = 1.4
large_fraction = 0.5
small_fraction = [0.25, 0.75]
seeds = 1
spheres = 30
hydrodynamics = "ball-melrose"
"#;

    fn read(text: &str) -> Result<Campaign, String> {
        crate::campaign::parse("one-more.toml", text.into()).map_err(|error| {
            let mut shown = String::new();
            miette::GraphicalReportHandler::new_themed(miette::GraphicalTheme::unicode_nocolor())
                .render_report(&mut shown, &error)
                .unwrap();
            shown
        })
    }

    #[test]
    fn file_has_it_with_its_range_and_where_it_has_a_meaning() {
        let campaign = read(FILE).unwrap();
        let large: Vec<f64> = campaign
            .cases
            .iter()
            .map(|(_, case)| case.params.large_fraction)
            .collect();
        assert_eq!(large, [0.75, 0.25]);
        assert_ne!(campaign.cases[0].0, campaign.cases[1].0, "keys");
        let error = read(&FILE.replace("[0.25, 0.75]", "1.5")).unwrap_err();
        assert!(
            error.contains("`small_fraction` is a number from 0 to 1"),
            "{error}"
        );
        assert!(error.contains("12 │ small_fraction = 1.5"), "{error}");
        let error = read(&FILE.replace("small_fraction", "smal_fraction")).unwrap_err();
        assert!(error.contains("did you mean `small_fraction`?"), "{error}");
        let error = read(&FILE.replace("size_ratio = 1.4", "size_ratio = 1")).unwrap_err();
        assert!(
            error.contains("`small_fraction` has no meaning in this grid"),
            "{error}"
        );
        assert!(error.contains("`size_ratio` above 1"), "{error}");
    }

    #[test]
    fn store_report_and_page_have_it() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("one-more.sqlite");
        let (store, _) = Store::enter(&path, &read(FILE).unwrap()).unwrap();
        let sql = rusqlite::Connection::open(&path).unwrap();
        let rows: Vec<f64> = sql
            .prepare("SELECT small_fraction FROM runs")
            .unwrap()
            .query_map([], |row| row.get(0))
            .unwrap()
            .collect::<Result<_, _>>()
            .unwrap();
        assert_eq!(rows, [0.25, 0.75]);

        let only = Selection::parse(&["small_fraction=0.75".to_owned()]).unwrap();
        let report = Report::of(&store, &only).unwrap();
        assert_eq!(report.points.len(), 1);
        assert_eq!(report.points[0].params.large_fraction, 0.25);
        let all = Report::of(&store, &Selection::default()).unwrap();
        let (mut json, mut text) = (Vec::new(), Vec::new());
        write_json(&all, &mut json).unwrap();
        write_text(&all, Shape::default(), None, &mut text).unwrap();
        let [json, text] = [json, text].map(|bytes| String::from_utf8(bytes).unwrap());
        assert!(json.contains("\"small_fraction\":0.25"));
        assert_eq!(point_table(&all)[0].name, "small_fraction");
        assert!(text.contains(" 0.25 ") && text.contains(" 0.75 "), "{text}");
        let excerpt = crate::report::Excerpt {
            store: &store,
            selection: &Selection::default(),
            units: crate::report::Units::default(),
        };
        let page: serde_json::Value =
            serde_json::from_str(&data(excerpt, PageHost::File).unwrap()).unwrap();
        assert_eq!(page["columns"][0]["name"], "small_fraction");
        assert_eq!(page["columns"][0]["cells"][1], "0.75");
    }
}

#[test]
fn friction_law_in_force_is_shown_where_there_is_friction() {
    let axis = Axis::of_key("tangential").unwrap();
    let mut params = params();
    params.friction = 0.5;
    assert_eq!(*params.contact.laws(), ContactLaws::PAPER);
    assert!(axis.matters([&params].into_iter()));
    params.friction = 0.0;
    assert!(!axis.matters([&params].into_iter()));
}
