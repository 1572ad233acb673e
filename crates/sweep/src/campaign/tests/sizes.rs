//! Sizes of the spheres in a campaign file.

use super::{Campaign, CampaignError, GOOD, parse_text};

/// One point with this in its grid.
fn with(text: &str) -> String {
    GOOD.replace("[0.0, 0.3]", "0.3")
        .replace("[0, 0.1, inf]", "inf")
        .replace("seeds = 4", &format!("seeds = 1\n{text}"))
}

/// The sizes of the cases, in their order.
fn sizes(campaign: &Campaign) -> Vec<String> {
    let cases = campaign.cases.iter();
    cases
        .filter_map(|(_, case)| Some(case.params.sizes.as_ref()?.to_string()))
        .collect()
}

#[test]
fn sizes_are_a_distribution_or_species_or_a_list_of_them() {
    for (text, expected) in [
        ("{ lognormal = 0.2 }", vec!["lognormal 0.2"]),
        (
            "[{ schulz = 0.1 }, { uniform = 0.3 }]",
            vec!["schulz 0.1", "uniform 0.3"],
        ),
        (
            "[{ radius = 2, fraction = 0.25 }, { radius = 1, fraction = 0.5 }, { radius = 1.4, fraction = 0.25 }]",
            vec!["1:0.5 1.4:0.25 2:0.25"],
        ),
        (
            "[{ lognormal = 0.2 }, [{ radius = 1, volume = 0.2 }, { radius = 1.25, volume = 0.5 }, { radius = 2, volume = 0.3 }]]",
            vec![
                "lognormal 0.2",
                "1:0.4052684903748734 1.25:0.5187436676798379 2:0.07598784194528875",
            ],
        ),
    ] {
        let campaign = parse_text(&with(&format!("sizes = {text}"))).unwrap();
        assert_eq!(sizes(&campaign), expected);
    }
    let suspension = with("sizes = { lognormal = 0.2 }")
        .replace("area_fraction = [0.693]", "volume_fraction = 0.1");
    assert_eq!(sizes(&parse_text(&suspension).unwrap()), ["lognormal 0.2"]);
}

#[test]
fn two_sizes_are_the_same_case_in_either_form() {
    let key = |text: &str| parse_text(&with(text)).unwrap().cases[0].0;
    let two = key("size_ratio = 1.4\nlarge_fraction = 0.5");
    for text in [
        "[{ radius = 1.0, fraction = 0.5 }, { radius = 1.4, fraction = 0.5 }]",
        "[{ radius = 1.4, fraction = 0.5 }, { radius = 1.0, fraction = 0.5 }]",
        "[[{ radius = 1.0, fraction = 0.5 }, { radius = 1.4, fraction = 0.5 }]]",
    ] {
        assert_eq!(key(&format!("sizes = {text}")), two, "{text}");
    }
    assert_eq!(key("sizes = [{ radius = 3, fraction = 1 }]"), key(""));
    assert_ne!(
        key("sizes = { lognormal = 0.2 }"),
        key("sizes = { lognormal = 0.1 }")
    );
}

#[test]
fn bad_sizes_are_refused_at_their_line_with_a_remedy() {
    for (text, place, said) in [
        ("sizes = []", "11:9: `sizes` is empty", "at least one value"),
        (
            "sizes = [[]]",
            "11:10: `sizes`: 0 species is out of range",
            "1 to 32 species",
        ),
        (
            "sizes = 0.2",
            "11:9: `sizes` cannot be of type",
            "{ lognormal = 0.2 }",
        ),
        (
            "sizes = { lognormol = 0.2 }",
            "11:11: unknown key `lognormol` in `sizes`",
            "did you mean `lognormal`?",
        ),
        (
            "sizes = { schulz = 0 }",
            "11:20: `sizes`: 0 is out of range",
            "a spread above 0",
        ),
        (
            "sizes = { uniform = 0.5 }",
            "11:9: `sizes` = uniform 0.5 makes radii from 0.1",
            "a smaller spread",
        ),
        (
            "sizes = [{ radius = 1, fraction = 0.5 }, { radius = 2, fraction = 0.4 }]",
            "11:9: `sizes`: fractions with a sum of 0.9 do not add up to a whole",
            "a sum of 1",
        ),
        (
            "sizes = [{ radius = 1, fraction = 0.5 }, { radius = 0, fraction = 0.5 }]",
            "11:53: `sizes`: a radius of 0 is out of range",
            "radii above 0",
        ),
        (
            "sizes = [{ radius = 1, fraction = 0.5 }, { radius = 2, area = 0.5 }]",
            "11:63: species give different kinds of fractions",
            "one kind for all",
        ),
        (
            "sizes = [{ radius = 1, fraction = 0.5 }, { radius = 2 }]",
            "11:42: a species needs a radius and one fraction",
            "`area` or `volume`",
        ),
        (
            "sizes = [{ radius = 1, fraction = 0.5 }, { radius = 12, fraction = 0.5 }]",
            "11:9: `sizes`: a size ratio of 12 is out of range",
            "at most 10",
        ),
        (
            "sizes = { lognormal = 0.2 }\nsize_ratio = 1.4",
            "12:14: `size_ratio` and `sizes` both set the sizes of the spheres",
            "one of them",
        ),
        (
            "sizes = [{ radius = 1, fraction = 0.5 }, { radius = 2, fraction = 0.5 }]\nlarge_fraction = 0.3",
            "12:18: `large_fraction` and `sizes` both set",
            "one of them",
        ),
    ] {
        let complaint = match parse_text(&with(text)) {
            Err(CampaignError::Faulty(fault)) => format!("{fault}\n{}", fault.allowed()),
            other => panic!("{text}: {other:?}"),
        };
        assert!(complaint.contains(place), "{text}: {complaint}");
        assert!(complaint.contains(said), "{text}: {complaint}");
    }
}

#[test]
fn every_number_of_spheres_that_is_needed_is_named_at_once() {
    let text = with("sizes = [{ lognormal = 0.1 }, { lognormal = 0.3 }]")
        .replace("area_fraction = [0.693]", "volume_fraction = [0.4, 0.5]")
        .replace("spheres = 90", "spheres = 60");
    let error = parse_text(&text).unwrap_err();
    let error = crate::ErrorRenderer::default().explain(&error.into());
    let words = error.replace('│', " ");
    let words = words.split_whitespace().collect::<Vec<_>>().join(" ");
    assert_eq!(words.matches("at least").count(), 4, "{error}");
    for part in [
        "`volume_fraction` = 0.4 and `sizes` = lognormal 0.1",
        "`volume_fraction` = 0.5 and `sizes` = lognormal 0.3",
        "with this `sizes`",
    ] {
        assert!(words.contains(part), "{part}: {error}");
    }
}
