import pytest

from published_results.values import Values

FILE = """friction,shear_rate,seeds,viscosity,rolling_fraction
0.1,0.0,8,7.0,
0.1,inf,8,9.8,0.625
0.3,inf,1,,
"""
NAMES = """What each line means.
rest | some | viscosity | friction=0.1 | shear_rate=0 | number
rolling | some | rolling_fraction % | friction=0.1 | shear_rate=inf | rounded
rise | some | viscosity | friction=0.1 | shear_rate=inf/0 | factor
more | some | viscosity | friction=0.1 | shear_rate=inf/0 | more
fewer | some | viscosity | friction=0.1 | shear_rate=inf/0 | less
jammed | some | viscosity | friction=0.3 | shear_rate=inf | number
several | some | viscosity | shear_rate=inf | number
"""


@pytest.fixture
def values(tmp_path):
    (tmp_path / "some.csv").write_text(FILE)
    (tmp_path / "values.txt").write_text(NAMES)
    return Values(tmp_path)


@pytest.mark.parametrize(
    "sentence",
    [
        "It rises 1.4<!-- value: rise --> times, by 40 %<!-- value: more -->.",
        "From 7<!-- value: rest --> on 62 %<!-- value: rolling --> roll.",
        "It rises<!-- claim: 1.2 < rise, rise < 1.5 -->, and not by much<!-- claim: more < 50 -->.",
    ],
)
def test_what_holds_is_left_as_it_is(values, sentence):
    assert values.written(sentence) == (sentence, [])


def test_numbers_are_written_and_their_sentences_named(values):
    page, again = values.written("One holds. It rises\n1.7<!-- value: rise --> times. So do others.")
    assert page == "One holds. It rises\n1.4<!-- value: rise --> times. So do others."
    assert again == ["1.7 is now 1.4: It rises 1.7 times."]


@pytest.mark.parametrize(
    ("sentence", "said"),
    [
        ("Flat<!-- claim: 0.97 < rise < 1.03 -->.", "0.97 < rise < 1.03: does not hold: Flat."),
        ("Falls by 4 %<!-- value: fewer -->.", "wrong direction"),
        ("It is 3<!-- value: jammed -->.", "where one is needed"),
        ("It is 3<!-- value: several -->.", "has 2 rows"),
        ("It is 3<!-- value: other -->.", "does not name it"),
        ("It is so,\n<!-- claim: 1 < rise --> it is.", "begins this line"),
        ("It is<!-- value: rest --> so.", "no number before it"),
    ],
)
def test_what_does_not_hold_is_named_and_left(values, sentence, said):
    page, again = values.written(sentence)
    assert page == sentence and len(again) == 1 and said in again[0]
