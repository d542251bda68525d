"""Bundled datasets, and the user's own in their place."""

from __future__ import annotations

import csv
import hashlib
import json
import re
import shutil
from collections import Counter
from dataclasses import replace
from pathlib import Path

import frictionless
import numpy as np
import pytest
from refusals import refused

from ifrfit import fit, read
from ifrfit.data import catalogue
from ifrfit.data.common_errors import loadings_of
from ifrfit.data.description import describe, listing_lines
from ifrfit.data.schema import SCHEMA
from ifrfit.errors import DataError, UsageError

ROOT = Path(__file__).resolve().parents[2]
NAMES = (
    "buck-2017",
    "cornell-glass",
    "cross-2019",
    "hashemnia-2019",
    "kharaz-2001",
    "netl-glass-acrylic",
    "reagle-2013",
    "wang-2018-limestone",
    "wang-2020",
)
REAL = ("cornell-glass", "kharaz-2001", "netl-glass-acrylic", "wang-2018-limestone")
STAND_INS = tuple(name for name in NAMES if name not in REAL)
MINE = (
    "series,observable,gamma_deg,value\nno spin,beta,20,0.41\nno spin,beta,60,-0.47\nno spin,beta,75,-0.75\n"
)


@pytest.fixture(autouse=True)
def own_folder(tmp_path, monkeypatch):
    """Keep the user's data folder of whoever runs the tests out of them."""
    monkeypatch.setenv("IFRFIT_DATA_DIR", str(tmp_path / "mine"))
    return tmp_path / "mine" / "datasets"


@pytest.fixture
def points(tmp_path):
    path = tmp_path / "points.csv"
    path.write_text(MINE, encoding="utf-8")
    return path


def raw_rows(name):
    with (ROOT / "datasets" / name / "data.csv").open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def test_names():
    assert catalogue.dataset_names() == NAMES


@pytest.mark.parametrize("name", NAMES)
def test_is_a_valid_frictionless_data_package(name):
    report = frictionless.validate(str(ROOT / "datasets" / name / "datapackage.json"))
    assert report.valid, report.flatten(["type", "message"])


@pytest.mark.parametrize("name", NAMES)
def test_checksum_size_licence_and_sources_are_stated(name):
    package = json.loads((ROOT / "datasets" / name / "datapackage.json").read_text(encoding="utf-8"))
    data = (ROOT / "datasets" / name / "data.csv").read_bytes()
    resource = package["resources"][0]
    assert resource["hash"] == f"sha256:{hashlib.sha256(data).hexdigest()}"
    assert resource["bytes"] == len(data)
    assert b"\r" not in data
    assert tuple(field["name"] for field in resource["schema"]["fields"]) == SCHEMA
    assert data.decode().splitlines()[0] == ",".join(SCHEMA)
    assert all(field["description"] for field in resource["schema"]["fields"])
    assert package["licenses"]
    assert package["sources"]


@pytest.mark.parametrize("name", NAMES)
def test_conditions_say_where_they_are_stated(name):
    descriptor = catalogue.load_dataset(name).sources[0].descriptor
    for wanted in ("diameter_mm", "material", "wall", "speed_m_s"):
        condition = descriptor.conditions[wanted]
        assert condition["where"] or condition["value"] in ("not printed", "not stated")


@pytest.mark.parametrize("name", NAMES)
def test_loads_every_row_unchanged(name):
    data = catalogue.load_dataset(name)
    raw = raw_rows(name)
    table = data.table
    assert len(data) == len(raw)
    assert table["value"].tolist() == [float(row["value"]) for row in raw]
    assert table["provenance"].tolist() == [row["provenance"] for row in raw]
    assert set(table["source"]) == {name}
    (source,) = data.sources
    assert (source.name, source.rows_used, source.rows) == (name, len(raw), len(raw))
    assert source.sha256 == hashlib.sha256((ROOT / "datasets" / name / "data.csv").read_bytes()).hexdigest()


@pytest.mark.parametrize("name", NAMES)
def test_the_default_selection_exists(name):
    data = catalogue.load_dataset(name)
    descriptor = data.sources[0].descriptor
    there = set(zip(data.table["series"], data.table["observable"], strict=True))
    for series in descriptor.default_series:
        for observable in descriptor.default_observables:
            assert (series, observable) in there
    for group in descriptor.faces:
        assert len(group) > 1
        assert set(group) <= set(data.table["series"])


def test_default_selections_and_noise_policies():
    chosen = {}
    for name in NAMES:
        d = catalogue.load_dataset(name).sources[0].descriptor
        chosen[name] = (d.default_series, d.default_observables, d.noise)
    assert chosen == {
        "buck-2017": (("no spin",), ("beta",), "known"),
        "cornell-glass": (("glass",), ("e_n", "beta_cm"), "unknown"),
        "cross-2019": (("no spin",), ("beta",), "scaled"),
        "hashemnia-2019": (("no spin",), ("beta",), "known"),
        "kharaz-2001": (("kratos",), ("beta_cm", "spin_y_after"), "scaled"),
        "netl-glass-acrylic": (("glass-acrylic",), ("e_n", "mu"), "unknown"),
        "reagle-2013": (("27 m/s",), ("beta_tot",), "known"),
        "wang-2018-limestone": (("0.1 m", "0.2 m"), ("v_x", "v_n", "spin_y_after"), "unknown"),
        "wang-2020": (("no spin",), ("delta_deg",), "known"),
    }


@pytest.mark.parametrize("name", STAND_INS)
def test_a_stand_in_says_so(name):
    data = catalogue.load_dataset(name)
    assert data.provenance == ("stand-in",)
    assert data.sources[0].descriptor.provenance == "stand-in"
    (sentence,) = (note for note in data.notes if "STAND-IN" in note)
    assert re.fullmatch(
        f"{name} is a STAND-IN, generated from the constants the paper prints: a fit to it shows that the "
        r"tool works, not what [\w\- ]+ on [\w\- ]+ does\.",
        sentence,
    )


def test_real_data_carry_no_stand_in_note():
    for name in REAL:
        assert not any("STAND-IN" in note for note in catalogue.load_dataset(name).notes)


def test_kharaz_signs_and_units():
    table = catalogue.load_dataset("kharaz-2001").table
    one = table[(table["series"] == "kratos") & (table["observable"] == "spin_y_after")].iloc[0]
    # -134.862 rad/s of the source, times 2.5 mm over 3.9 m/s
    assert one["value"] == pytest.approx(-134.86238532110102 * 2.5e-3 / 3.9, rel=1e-5)
    for observable in ("beta_cm", "spin_y_after"):
        assert (table.loc[table["observable"] == observable, "value"] < 0).all()
    assert set(table["speed_m_s"]) == {3.9}
    simulated = table["series"] == "chungooi-dem"
    assert set(table.loc[simulated, "provenance"]) == {"simulated"}
    assert set(table.loc[~simulated, "provenance"]) == {"digitised"}


def test_kharaz_contact_angle_has_the_sign_of_the_contact_velocity():
    # V_x = v_x + R Omega from the other two observables, near 20 degrees where the contact point reverses
    table = catalogue.load_dataset("kharaz-2001").table
    kratos = table[table["series"] == "kratos"]

    def at(observable, gamma):
        rows = kratos[kratos["observable"] == observable].sort_values("gamma_deg")
        return float(np.interp(gamma, rows["gamma_deg"], rows["value"]))

    for gamma in (20.3, 49.5, 70.5):
        contact = -at("beta_cm", gamma) * np.sin(np.radians(gamma)) + at("spin_y_after", gamma)
        angle = np.degrees(np.arctan2(contact, 0.98 * np.cos(np.radians(gamma))))
        assert angle == pytest.approx(at("psi_out_deg", gamma), abs=2.0)


def test_netl_counts_and_spread():
    # mean and standard deviation as the source's own page prints them
    table = catalogue.load_dataset("netl-glass-acrylic").table
    e_n = table.loc[table["observable"] == "e_n", "value"]
    mu = table.loc[table["observable"] == "mu", "value"]
    assert (len(e_n), len(mu)) == (179, 55)
    assert (round(e_n.mean(), 4), round(e_n.std(), 4)) == (0.9549, 0.0374)
    assert (round(mu.mean(), 4), round(mu.std(), 4)) == (0.2514, 0.0756)
    assert table["sigma"].isna().all()
    assert table["gamma_deg"].isna().all()


def test_rocks_are_as_their_authors_measured_them():
    """Line 18 of the supplement: 0.1 m, from 5.366 and 3.65 m/s to 2.57 and 2.898 m/s, 48.4 rad/s."""
    table = catalogue.load_dataset("wang-2018-limestone").table
    assert table.value_counts(["series", "observable"]).to_dict() == {
        (series, observable): count
        for series, count in (("0.1 m", 38), ("0.2 m", 37))
        for observable in ("v_x", "v_n", "spin_y_after")
    }
    first = table[table["impact_id"] == "row-18"].set_index("observable")
    speed = np.hypot(5.366, 3.65)
    assert first["speed_m_s"].to_numpy() == pytest.approx([speed] * 3, abs=1e-6)
    assert first["gamma_deg"].to_numpy() == pytest.approx([np.degrees(np.arctan2(3.65, 5.366))] * 3, abs=1e-5)
    assert first["value"].to_dict() == pytest.approx(
        {"v_x": 2.898 / speed, "v_n": 2.57 / speed, "spin_y_after": -48.4 * 0.05 / speed}, abs=1e-6
    )


def test_printed_constants_by_series():
    printed = catalogue.printed_constants("cross-2019")
    assert printed["no spin"] == {"e_n": 0.94, "e_t": -0.98, "mu": 0.12}
    assert printed["spin 0.833"] == {"e_n": 0.94, "e_t": -0.98, "mu": 0.14}
    assert catalogue.printed_constants("kharaz-2001") == {}
    assert catalogue.load_dataset("buck-2017").sources[0].descriptor.printed_constants == {
        "e_n": 0.78,
        "e_t": -0.80,
        "mu": 0.01,
    }


@pytest.mark.parametrize("name", NAMES)
def test_describe_tells_what_there_is(name):
    lines, data = describe(name), catalogue.load_dataset(name)
    assert max(map(len, lines)) <= 88
    text = " ".join(" ".join(lines).split())
    (source,) = data.sources
    for part in (name, source.descriptor.provenance, source.sha256, source.descriptor.licence):
        assert part in text
    for (series, observable), count in Counter(
        (r["series"], r["observable"]) for r in raw_rows(name)
    ).items():
        assert re.search(f"{re.escape(series)}: [^:]*{count} {observable}", text)
    for sentence in (*source.descriptor.assumptions, *data.notes):
        assert sentence in text


def test_the_list_says_what_a_stand_in_is_where_there_is_one_and_what_is_yours():
    real = [entry for entry in catalogue.listing() if entry.name in REAL]
    assert "install" not in " ".join(listing_lines(real))
    kharaz = next(entry for entry in real if entry.name == "kharaz-2001")
    mine = listing_lines([replace(kharaz, installed=kharaz.bundled)])
    assert mine[0].startswith("kharaz-2001  digitised (yours)  Aluminium")


@pytest.mark.parametrize(
    "name", ["cros-2019", "../datasets/cross-2019", "", ".", "..", "cross-2019/", "/etc"]
)
def test_unknown_names_are_refused(name):
    for call in (catalogue.load_dataset, describe, catalogue.remove, catalogue.printed_constants):
        with refused(UsageError, match=re.escape(f"There is no dataset '{name}'.")):
            call(name)


def test_unknown_name_lists_the_names_and_the_close_one(points):
    with refused(UsageError) as error:
        catalogue.install("cros-2019", points)
    assert error.value.in_shell == (
        "There is no dataset 'cros-2019'. Did you mean cross-2019? The datasets are " + ", ".join(NAMES) + "."
    )


# ------------------------------------------------------------------------------------------------ resolve


def test_resolve_a_name_a_file_and_a_folder(points):
    assert catalogue.resolve("kharaz-2001").sources[0].name == "kharaz-2001"
    assert len(catalogue.resolve(points)) == 3
    folder = catalogue.resolve(ROOT / "datasets" / "wang-2020")
    assert folder.sources[0].name == "wang-2020"
    assert "STAND-IN" in folder.notes[0]


def test_resolve_names_both_possibilities(tmp_path, points):
    with refused(DataError) as error:
        catalogue.resolve(tmp_path / "point.csv")
    assert error.value.in_shell == (
        f"{tmp_path / 'point.csv'}: there is neither a file nor a dataset of that name. Did you mean "
        "points.csv? The datasets are " + ", ".join(NAMES) + "."
    )


def test_resolve_refuses_conventions_for_a_dataset():
    with refused(UsageError, match="kharaz-2001 is a dataset in the common schema: leave --convention away"):
        catalogue.resolve("kharaz-2001", convention=("angle=gamma_deg:from-wall",))


# --------------------------------------------------------------------------------------- damaged folders


@pytest.fixture
def damaged(tmp_path):
    return Path(shutil.copytree(ROOT / "datasets" / "wang-2020", tmp_path / "wang-2020"))


def test_changed_data_are_refused(damaged):
    with (damaged / "data.csv").open("a", encoding="utf-8") as file:
        file.write("no spin,delta_deg,50,,,,,,48,1,,,stand-in\n")
    with refused(
        DataError, match=r"data\.csv: is not the file that datapackage\.json describes \(another SHA-256\)"
    ):
        catalogue.load_folder(damaged)


def test_changed_bundled_data_are_refused(tmp_path, monkeypatch, damaged):
    (damaged / "data.csv").write_text(MINE, encoding="utf-8")
    monkeypatch.setattr(catalogue, "bundled_root", lambda: tmp_path)
    with refused(DataError, match="Install ifrfit again"):
        catalogue.load_dataset("wang-2020")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda p: p["ifrfit"].pop("provenance"), "has no object 'ifrfit' that states a provenance"),
        (lambda p: p.pop("ifrfit"), "has no object 'ifrfit' that states a provenance"),
        (
            lambda p: p["ifrfit"].update(default_series="no spin"),
            "'ifrfit' has a default_series of the wrong type",
        ),
        (
            lambda p: p["ifrfit"].update(inertia_factor="2/5"),
            "'ifrfit' has a inertia_factor of the wrong type",
        ),
        (
            lambda p: p["resources"][0].update(path="../data.csv"),
            r"the path '\.\./data\.csv' leaves the folder",
        ),
        (lambda p: p["resources"][0].pop("hash"), "names no resource with a path and a hash"),
        (lambda p: p["resources"][0].update(path="other.csv"), r"other\.csv: cannot be read"),
    ],
    ids=["no provenance", "no ifrfit", "series", "inertia factor", "path outside", "no hash", "no file"],
)
def test_broken_packages_are_refused(damaged, change, message):
    path = damaged / "datapackage.json"
    package = json.loads(path.read_text(encoding="utf-8"))
    change(package)
    path.write_text(json.dumps(package), encoding="utf-8")
    with refused(DataError, match=message):
        catalogue.load_folder(damaged)


def test_a_folder_without_package_and_bad_json_are_refused(damaged):
    (damaged / "datapackage.json").write_text("{", encoding="utf-8")
    with refused(DataError, match="cannot be read as JSON"):
        catalogue.load_folder(damaged)
    (damaged / "datapackage.json").unlink()
    with refused(DataError, match=r"there is no datapackage\.json"):
        catalogue.load_folder(damaged)


def test_missing_datasets_are_reported(monkeypatch, tmp_path):
    monkeypatch.setattr(catalogue, "files", lambda package: tmp_path / "ifrfit")
    with refused(DataError, match="The bundled datasets are missing"):
        catalogue.dataset_names()


def test_the_wheel_s_folder_comes_first(monkeypatch, tmp_path):
    inside = tmp_path / "ifrfit" / "_datasets"
    shutil.copytree(ROOT / "datasets" / "wang-2020", inside / "wang-2020")
    monkeypatch.setattr(catalogue, "files", lambda package: tmp_path / "ifrfit")
    assert catalogue.dataset_names() == ("wang-2020",)


# ------------------------------------------------------------------------------------ install and remove


def test_install_replaces_and_remove_restores(points, own_folder):
    before = catalogue.load_dataset("cross-2019")
    assert catalogue.install("cross-2019", points) == own_folder / "cross-2019"
    mine = catalogue.load_dataset("cross-2019")
    assert mine.provenance == ("digitised",)
    assert mine.table["value"].tolist() == [0.41, -0.47, -0.75]
    assert mine.notes == (
        "cross-2019: your digitisation replaces the bundled stand-in (from points.csv); "
        "'ifrfit datasets remove cross-2019' brings it back.",
    )
    descriptor = mine.sources[0].descriptor
    assert descriptor.provenance == "digitised"
    assert descriptor.noise is None
    assert descriptor.assumptions == ()
    assert descriptor.default_series == ("no spin",)
    assert descriptor.default_observables == ("beta",)
    assert descriptor.title == "Steel ball on polished granite, without and with spin (Cross 2019)"
    entry = next(entry for entry in catalogue.listing() if entry.name == "cross-2019")
    assert (entry.package["ifrfit"]["provenance"], entry.installed) == (
        "digitised",
        own_folder / "cross-2019",
    )
    assert "provenance    digitised (installed by you)" in describe("cross-2019")
    catalogue.remove("cross-2019")
    assert catalogue.load_dataset("cross-2019").table.equals(before.table)
    assert list(own_folder.iterdir()) == []


def test_installed_data_are_a_data_package_with_the_original_named(points, own_folder):
    catalogue.install("cross-2019", points)
    folder = own_folder / "cross-2019"
    assert frictionless.validate(str(folder / "datapackage.json")).valid
    package = json.loads((folder / "datapackage.json").read_text(encoding="utf-8"))
    assert package["ifrfit"]["installed"] == {
        "original_file": "points.csv",
        "original_sha256": hashlib.sha256(MINE.encode()).hexdigest(),
        "replaces": "stand-in",
    }


def test_rows_keep_the_provenance_they_state(tmp_path):
    path = tmp_path / "mixed.csv"
    path.write_text(
        "series,observable,gamma_deg,value,provenance\n"
        "no spin,beta,20,0.41,measured\nno spin,beta,60,-0.47,\nno spin,beta,70,-0.7,simulated\n",
        encoding="utf-8",
    )
    catalogue.install("cross-2019", path)
    data = catalogue.load_dataset("cross-2019")
    assert data.table["provenance"].tolist() == ["measured", "digitised", "simulated"]
    assert data.sources[0].descriptor.provenance == "simulated"  # the least claim counts
    path.write_text(path.read_text(encoding="utf-8").replace("simulated", ""), encoding="utf-8")
    catalogue.install("cross-2019", path, provenance="measured")
    assert catalogue.load_dataset("cross-2019").provenance == ("measured",)
    assert "your measurement replaces" in catalogue.load_dataset("cross-2019").notes[0]


def test_a_printed_table_is_published_up_to_the_result(tmp_path):
    path = tmp_path / "table.csv"
    rows = (
        "series,gamma_deg,beta,sigma",
        *(f"no spin,{row},0.02" for row in ("20,0.41", "60,-0.47", "75,-0.75")),
    )
    path.write_text("\n".join(rows) + "\n", encoding="utf-8")
    catalogue.install("cross-2019", path, provenance="published")
    data = catalogue.load_dataset("cross-2019")
    assert data.provenance == ("published",)
    assert data.notes[0].startswith("cross-2019: your table replaces the bundled stand-in (from table.csv); ")
    found = fit(data, fix={"e_n": 0.94}, method="lsq")
    assert "3 impacts, beta, published, sigma given" in found.summary()
    assert "Printed in a table of a publication, rounded as it stands there." in found.summary()
    assert found.to_dict()["input"][0]["provenance"] == "published"
    figure = found.plot()
    legends = [*figure.legends, *(axes.get_legend() for axes in figure.axes)]
    legend = [text.get_text() for one in legends if one is not None for text in one.get_texts()]
    assert any("(published)" in text for text in legend)


def test_a_stand_in_cannot_be_installed(tmp_path):
    path = tmp_path / "copy.csv"
    shutil.copy(ROOT / "datasets" / "cross-2019" / "data.csv", path)
    with refused(
        DataError, match=r"copy\.csv, line 2, column provenance: a stand-in cannot replace cross-2019"
    ):
        catalogue.install("cross-2019", path)
    with refused(
        UsageError, match="Provenance 'stand-in' cannot be installed: use one of measured, published"
    ):
        catalogue.install("cross-2019", path, provenance="stand-in")


def test_refused_data_leave_nothing_and_keep_the_earlier_ones(points, tmp_path, own_folder):
    bad = tmp_path / "bad.csv"
    bad.write_text(MINE + "no spin,beta,95,0.3\n", encoding="utf-8")
    with refused(DataError):
        catalogue.install("cross-2019", bad)
    assert not own_folder.exists()
    catalogue.install("cross-2019", points)
    with refused(DataError):
        catalogue.install("cross-2019", bad)
    assert len(catalogue.load_dataset("cross-2019")) == 3


def test_installing_again_replaces_the_earlier_file(points, tmp_path, own_folder):
    catalogue.install("cross-2019", points)
    second = tmp_path / "second.csv"
    second.write_text("".join(MINE.splitlines(keepends=True)[:3]), encoding="utf-8")
    catalogue.install("cross-2019", second)
    assert len(catalogue.load_dataset("cross-2019")) == 2
    assert "second.csv" in catalogue.load_dataset("cross-2019").notes[0]
    assert [path.name for path in own_folder.iterdir()] == ["cross-2019"]


def test_a_failed_write_brings_the_earlier_data_back(points, tmp_path, own_folder, monkeypatch):
    catalogue.install("cross-2019", points)
    second = tmp_path / "second.csv"
    second.write_text("".join(MINE.splitlines(keepends=True)[:3]), encoding="utf-8")
    replace = Path.replace

    def fail_for_new(self, target):
        if self.name == "new":
            raise OSError(28, "No space left on device")
        return replace(self, target)

    monkeypatch.setattr(Path, "replace", fail_for_new)
    with refused(DataError, match="cannot be written \\(No space left on device\\)"):
        catalogue.install("cross-2019", second)
    monkeypatch.undo()
    monkeypatch.setenv("IFRFIT_DATA_DIR", str(own_folder.parent))
    assert len(catalogue.load_dataset("cross-2019")) == 3
    assert [path.name for path in own_folder.iterdir()] == ["cross-2019"]


def test_damaged_installed_data_name_the_way_out(points, own_folder):
    catalogue.install("cross-2019", points)
    (own_folder / "cross-2019" / "data.csv").write_text(MINE, encoding="utf-8")
    with refused(DataError, match="Run 'ifrfit datasets remove cross-2019' and install your file again"):
        catalogue.load_dataset("cross-2019")


def test_remove_without_install_is_refused():
    with refused(
        UsageError, match="Nothing of yours is installed for cross-2019: the bundled dataset is in use"
    ):
        catalogue.remove("cross-2019")


def test_series_of_another_name_leave_the_default_open(tmp_path):
    path = tmp_path / "fig3.csv"
    path.write_text("observable,gamma_deg,value\nmu_app,60,0.13\nmu_app,70,0.14\n", encoding="utf-8")
    catalogue.install("cross-2019", path)
    descriptor = catalogue.load_dataset("cross-2019").sources[0].descriptor
    assert descriptor.default_series == ()
    assert descriptor.default_observables == ()


def test_numbers_survive_installation_to_the_last_digit(tmp_path):
    path = tmp_path / "digits.csv"
    path.write_text(
        "observable,gamma_deg,value,sigma\nbeta,20.123456789012345,0.1234567890123456,0.1\n", encoding="utf-8"
    )
    catalogue.install("cross-2019", path)
    row = catalogue.load_dataset("cross-2019").table.iloc[0]
    assert (row["gamma_deg"], row["value"]) == (20.123456789012345, 0.1234567890123456)


def test_errors_in_common_survive_installation(own_folder):
    """A digitised figure in the place of a stand-in has the intervals that it has by itself."""
    project = ROOT / "docs" / "how-to" / "digitise" / "figure.json"
    axes = ("x=gamma_deg", "y=beta")
    folder = catalogue.install("cross-2019", project, convention=axes)
    assert frictionless.validate(str(folder / "datapackage.json")).valid
    alone, installed = read(project, convention=axes), catalogue.load_dataset("cross-2019")
    for ours, theirs in zip(loadings_of(installed.table), loadings_of(alone.table), strict=True):
        np.testing.assert_array_equal(ours, theirs)
    catalogue.remove("cross-2019")
    assert loadings_of(catalogue.load_dataset("cross-2019").table)[2] == ()


def test_without_the_variable_the_users_data_folder_is_used(monkeypatch):
    monkeypatch.delenv("IFRFIT_DATA_DIR")
    assert catalogue.user_root().parts[-2:] == ("ifrfit", "datasets")
