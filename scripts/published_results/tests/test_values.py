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
        "It rises 1.4<!--\nvalue: rise --> times, by 40 %<!-- value:\nmore -->.",
        "From 7<!-- value: rest --> on 62 %<!-- value: rolling --> roll.",
        "It rises<!-- claim: 1.2 < rise, rise < 1.5 -->, and not by much<!-- claim: more < 50 -->.",
        "All are of this size<!-- claim: 1.3 < r* < 63 -->.",
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
        ("High<!-- claim: 1.5 < r* -->.", "1.5 < r*: does not hold: High."),
        ("Falls by 4 %<!-- value: fewer -->.", "wrong direction"),
        ("It is 3<!-- value: jammed -->.", "where one is needed"),
        ("It is 3<!--\nvalue: jammed -->.", "where one is needed"),
        ("It is 3<!-- value: several -->.", "has 2 rows"),
        ("It is 3<!-- value: other -->.", "does not name it"),
        ("It is so,\n<!-- claim: 1 < rise --> it is.", "begins this line"),
        ("It is<!-- value: rest --> so.", "no number before it"),
    ],
)
def test_what_does_not_hold_is_named_and_left(values, sentence, said):
    page, again = values.written(sentence)
    assert page == sentence and len(again) == 1 and said in again[0]


MARKED = """friction,seeds,viscosity,jammed,not_steady,ordering
0.1,8,7.0,2,1,0
0.2,8,7.5,0,0,1
0.3,8,8.0,0,0,0
"""
OF_THESE = "".join(f"marked-{friction} | marked | viscosity | friction={friction} | number\n" for friction in [0.1, 0.2, 0.3])


@pytest.mark.parametrize(
    ("sentence", "said"),
    [
        ("It is 7<!-- value: marked-0.1 -->.", "marked-0.1 are not steady"),
        ("It is low<!-- claim: 1 < marked-0.1 < 9 -->.", "marked-0.1 are not steady"),
        ("It is 7<!-- value: marked-0.1 -->, but not steady.", None),
        ("Runs are not\nin steady state at 7<!-- value: marked-0.1 -->.", None),
        # A heading in the line belongs to the sentence after it, and no other does.
        ("**They are not steady.** It is 7<!-- value: marked-0.1 -->.", None),
        ("They are not steady. It is 7<!-- value: marked-0.1 -->.", "marked-0.1 are not steady"),
        # The number of runs that jam is no average over the strain.
        ("Here 2<!-- value: jams --> jam.", None),
        ("It is 7.5<!-- value: marked-0.2 -->.", "marked-0.2 are ordering"),
        ("Spheres are ordering at 7.5<!-- value: marked-0.2 -->.", None),
        ("It is 8<!-- value: marked-0.3 -->.", None),
    ],
)
def test_a_sentence_that_quotes_unsteady_runs_must_say_so(tmp_path, sentence, said):
    (tmp_path / "marked.csv").write_text(MARKED)
    (tmp_path / "values.txt").write_text(OF_THESE + "jams | marked | jammed | friction=0.1 | number\n")
    page, again = Values(tmp_path).written(sentence)
    assert page == sentence
    assert len(again) == (1 if said else 0) and (not said or said in again[0])
