"""The datum of a survey: what is free, what is held, what depends on it and what does not."""

from dataclasses import replace

import numpy as np
import pytest
from surveyed import by_instruments, by_photographs, known, table

from tankcal.errors import InputError, SolutionError
from tankcal.survey import adjust_survey
from tankcal.survey.measurements import AdjustmentSettings
from tankcal.survey.network.datum import depends_on_datum
from tankcal.survey.observations import ControlCoordinates, Distances

PAIRS = [("P0", "P17"), ("P3", "P40"), ("P12", "P45"), ("P7", "P30"), ("P20", "P26")]


@pytest.fixture(scope="module")
def photos():
    return by_photographs()[0]


def chosen(measurements, datum, **settings):
    return adjust_survey(
        replace(measurements, settings=AdjustmentSettings(datum=datum, **settings))
    )


def shape(adjustment):
    """Distances between points and their sds, (5, 2)."""
    place = {name: i for i, name in enumerate(adjustment.names)}
    rows = []
    for pair in PAIRS:
        d = adjustment.xyz_m[place[pair[0]]] - adjustment.xyz_m[place[pair[1]]]
        length = np.linalg.norm(d)
        a = np.concatenate([d, -d]) / length
        rows.append((length, np.sqrt(a @ adjustment.full_covariance_m2(pair) @ a)))
    return np.array(rows)


@pytest.mark.slow
def test_the_shape_is_the_same_in_every_datum(photos, figure):
    """Property: distances and their sds to 1e-8, whatever holds the frame; places differ."""
    free = chosen(photos, "inner")
    expected, worst = shape(free), 0.0
    others = [
        chosen(photos, "minimal"),
        chosen(photos, "minimal", datum_points=(("P1", "xyz"), ("P7", "xz"), ("P43", "y"))),
        chosen(photos, "inner", datum_points=(("P1", "xyz"), ("P7", "xyz"), ("P43", "xyz"))),
        *(chosen(photos, "fixed_photo", fixed_photo=f"S{i}") for i in range(8)),
    ]
    for other in others:
        assert (other.redundancy, other.datum.defect) == (free.redundancy, 6)
        assert other.sigma0 == pytest.approx(free.sigma0, rel=1e-9)
        worst = max(worst, np.abs(shape(other) / expected - 1).max())
    figure("distances and their sds in eleven datums differ by", f"{worst:.1e}")
    assert worst < 1e-8
    traces = [np.trace(one.full_covariance_m2()) for one in others]
    assert max(traces) / min(traces) > 1.5


@pytest.mark.slow
def test_quantities_that_depend_on_the_datum(photos):
    """Property: coordinates depend on it; lengths do when no tape gives the scale."""
    found = chosen(photos, "inner").adjusted
    line = Distances(
        np.ones(2), np.ones(2), np.array([0, 3]), np.array([17, 40]), instrument=np.full(2, -1)
    )
    place = ControlCoordinates(np.zeros(1), np.ones(1), np.array([4]), np.array([0]))
    assert not depends_on_datum(found, line).any()
    assert depends_on_datum(found, place).all()
    bare = chosen(replace(photos, readings=(), instruments=()), "inner").adjusted
    assert depends_on_datum(bare, line).all()


@pytest.mark.slow
def test_minimal_takes_control_that_is_far_apart(photos):
    """As many coordinates as the defect; the sds are nowhere near Silva's 1.37 m."""
    found = chosen(photos, "minimal")
    assert sum(len(name.split(":")[1]) for name in found.datum.held) == 6
    assert {name.split(":")[0] for name in found.datum.held} <= set(photos.control.point)
    assert np.count_nonzero(found.fixed) == 6
    held = found.xyz_m[found.fixed]
    given = dict(zip(photos.control.point, photos.control.xyz_m, strict=True))
    expected = [given[name] for name in np.array(found.names)[found.fixed.any(axis=1)]]
    mask = found.fixed[found.fixed.any(axis=1)]
    assert held == pytest.approx(np.array(expected)[mask], abs=1e-12)
    assert np.sqrt(np.einsum("nii->ni", found.covariance_m2)).max() < 0.01
    assert found.check_points is not None
    assert len(found.check_points.names) == 8
    assert not any(one.kind == "control coordinate" for one in found.readings)


@pytest.mark.slow
def test_too_few_and_too_many_held_coordinates(photos):
    with pytest.raises(SolutionError, match=r"datum defect 6: three translations .* fix 3 of 6"):
        chosen(photos, "minimal", datum_points=(("P1", "xyz"),))
    much = chosen(photos, "minimal", datum_points=(("P1", "xyz"), ("P7", "xyz"), ("P43", "y")))
    assert any("7 coordinates are held where 6 are enough" in str(one) for one in much.warnings)
    with pytest.raises(
        InputError, match=r"job.toml, adjustment.datum_points: X9 is not an adjusted"
    ):
        chosen(photos, "inner", datum_points=(("X9", "xyz"), ("P1", "xyz")))
    with pytest.raises(InputError, match="nobody is not a photo of this survey"):
        chosen(photos, "fixed_photo", fixed_photo="nobody")
    with pytest.raises(SolutionError, match="inner constraints over 2 points fix 5 of 6"):
        chosen(photos, "inner", datum_points=(("P1", "xyz"), ("P7", "xyz")))
    bare = replace(photos, readings=(), instruments=())
    with pytest.raises(SolutionError, match=r"datum defect 1: .*scale"):
        chosen(bare, "fixed_photo", fixed_photo="S0")


@pytest.mark.slow
def test_a_frame_that_is_known_leaves_nothing_to_choose(photos):
    """Photos whose places are known fix everything: inner and minimal have nothing to do."""
    _, truth = by_photographs()
    sd = np.array([0.01] * 3 + [np.nan] * 3)
    pictures = tuple(
        replace(one, values=np.append(truth.photo_xyz_m[i], [np.nan] * 3), sd=sd)
        for i, one in enumerate(photos.photos)
    )
    for datum in ("inner", "minimal"):
        found = chosen(replace(photos, photos=pictures), datum)
        assert found.datum.defect == 0
        assert found.datum.words == ""
        assert any("has nothing to fix" in str(one) for one in found.warnings)


@pytest.mark.slow
def test_without_control_the_defect_is_reported_in_words(photos):
    message = (
        "datum defect 6: three translations and three rotations are not determined by any "
        "observation; add control or choose datum = inner"
    )
    with pytest.raises(SolutionError, match=message):
        adjust_survey(replace(photos, control=None))
    stations, _ = by_instruments()
    with pytest.raises(SolutionError, match="datum defect 4: three translations and the rotation"):
        adjust_survey(replace(stations, control=None))


@pytest.mark.slow
def test_vertical_and_scale_are_judged_by_given_values(photos):
    """Plumb lines, zenith angles and declared control know the vertical; a photo does not."""
    bare = replace(photos, control=None)
    report = chosen(bare, "inner").datum
    assert (report.defect, report.vertical, report.scale) == (6, False, True)
    assert report.words.startswith("datum defect 6: three translations and three rotations")
    none = chosen(replace(bare, readings=(), instruments=()), "inner").datum
    assert (none.defect, none.vertical, none.scale) == (7, False, False)
    assert not chosen(photos, "fixed_photo", fixed_photo="S0").datum.vertical
    assert adjust_survey(photos).datum.vertical
    assert chosen(photos, "inner").datum.vertical  # over control that is declared
    approximate = replace(photos.control, sd_m=np.full((8, 3), np.nan))
    assert not chosen(replace(photos, control=approximate), "inner").datum.vertical
    plumb = table("plumb_lines", np.zeros(3), 0.05, ["P0", "P3", "P6"], ["P36", "P39", "P42"])
    found = chosen(replace(bare, readings=(*photos.readings, plumb)), "inner")
    assert (found.datum.defect, found.datum.vertical) == (4, True)
    stations, _ = by_instruments()
    report = chosen(replace(stations, control=None), "inner").datum
    assert (report.defect, report.vertical, report.scale) == (4, True, True)


@pytest.mark.slow
def test_fixed_control_is_held_exactly(photos):
    names = [int(name[1:]) for name in photos.control.point]
    _, truth = by_photographs()
    fixed = replace(photos, control=known(photos.control.point, truth.xyz_m[names], 0.0))
    found = adjust_survey(fixed)
    place = [found.names.index(name) for name in photos.control.point]
    assert found.fixed[place].all()
    assert found.xyz_m[place] == pytest.approx(truth.xyz_m[names], abs=1e-12)
    assert np.abs(found.covariance_m2[place]).max() == 0
    assert 0.7 < found.sigma0 < 1.3


@pytest.mark.slow
def test_a_coordinate_may_be_unknown_or_approximate(photos):
    """Blank values and blank sds: such coordinates do not act, all others do."""
    xyz, sd = photos.control.xyz_m.copy(), photos.control.sd_m.copy()
    xyz[0, 2] = np.nan
    sd[1] = np.nan
    found = adjust_survey(replace(photos, control=replace(photos.control, xyz_m=xyz, sd_m=sd)))
    acting = [one for one in found.readings if one.kind == "control coordinate"]
    assert len(acting) == 24 - 1 - 3
    assert found.datum.held[0] == f"{photos.control.point[0]}:xy"


SOME = {"P1": "xyz", "P7": "z"}  # held: of the six that are free, these leave two


def partly_held(measurements):
    """Measurements with the coordinates of SOME held, and all other control weighted."""
    control = measurements.control
    sd = control.sd_m.copy()
    for name, axes in SOME.items():
        sd[control.point.index(name), ["xyz".index(axis) for axis in axes]] = 0.0
    return replace(measurements, control=replace(control, sd_m=sd))


@pytest.mark.slow
def test_inner_constraints_complement_held_coordinates(photos, figure):
    """Invariance: held coordinates stay, their sds are 0, the shape is that of any other datum."""
    measurements = partly_held(photos)
    found, plain = chosen(measurements, "inner"), chosen(photos, "inner")
    given = dict(zip(photos.control.point, photos.control.xyz_m, strict=True))
    for name, axes in SOME.items():
        place, columns = found.names.index(name), ["xyz".index(axis) for axis in axes]
        assert found.xyz_m[place, columns] == pytest.approx(given[name][columns], abs=1e-12)
        assert np.abs(found.covariance_m2[place][columns]).max() == 0
        assert found.fixed[place, columns].all()
    assert np.count_nonzero(found.fixed) == 4
    assert found.redundancy == plain.redundancy
    assert found.sigma0 == pytest.approx(plain.sigma0, rel=1e-9)
    worst = np.abs(shape(found) / shape(plain) - 1).max()
    figure("distances and their sds with held coordinates and inner constraints differ by",
           f"{worst:.1e}")  # fmt: skip
    assert worst < 1e-8
    assert found.datum.held[:2] == ("P1:xyz", "P7:z")
    assert not set(SOME) & set(found.check_points.names) - {"P7"}


@pytest.mark.slow
def test_inner_constraints_give_smallest_trace(photos):
    """Property: over the points of the constraints, among minimal datums with the same held."""
    measurements = partly_held(photos)
    over = tuple((name, "xyz") for name in ("P13", "P19", "P25", "P31", "P37", "P43"))
    names = [name for name, _ in over]
    least = np.trace(chosen(measurements, "inner", datum_points=over).full_covariance_m2(names))
    held = tuple(SOME.items())
    for more in ((("P37", "x"), ("P43", "x")), (("P37", "x"), ("P31", "x")),
                 (("P25", "x"), ("P19", "x")), (("P37", "y"), ("P43", "y"))):  # fmt: skip
        other = chosen(measurements, "minimal", datum_points=(*held, *more))
        assert np.trace(other.full_covariance_m2(names)) > 1.0001 * least
    plain = chosen(photos, "inner", datum_points=over)
    assert np.trace(plain.full_covariance_m2(names)) < least  # nothing held: smaller still


@pytest.mark.slow
def test_inner_constraints_with_fully_held_control(photos):
    _, truth = by_photographs()
    names = [int(name[1:]) for name in photos.control.point]
    fixed = replace(photos, control=known(photos.control.point, truth.xyz_m[names], 0.0))
    found, other = chosen(fixed, "inner"), adjust_survey(fixed)
    assert found.xyz_m == pytest.approx(other.xyz_m, abs=1e-9)
    assert found.covariance_m2 == pytest.approx(other.covariance_m2, rel=1e-6, abs=1e-14)
    assert any("datum = inner has nothing to fix" in str(one) for one in found.warnings)
    assert [one.w for one in found.readings if one.kind == "control coordinate"] == pytest.approx(
        [one.w for one in other.readings if one.kind == "control coordinate"], abs=1e-4
    )


@pytest.mark.slow(after=1)
@pytest.mark.parametrize("datum", ["minimal", "fixed_photo"])
def test_held_control_that_a_datum_releases_is_reported(photos, datum):
    photo = {"fixed_photo": "S0"} if datum == "fixed_photo" else {}
    found = chosen(partly_held(photos), datum, **photo)
    text = "\n".join(map(str, found.warnings))
    assert f"datum = {datum} does not hold them: they are compared only" in text
