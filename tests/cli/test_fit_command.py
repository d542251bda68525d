"""`ifrfit fit`: what stands on standard output and in the folder."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from json_schemas import validator

import ifrfit

OWN = ["fit.png", "fit.svg", "report.html", "result.json"]
# of the run, not of the fit
PASSING = ("created", "command")
LSQ = ("--method", "lsq")


@pytest.fixture(scope="module")
def schema():
    return validator("result")


def strict_json(text: str) -> dict[str, object]:
    def refuse(word: str) -> None:
        raise AssertionError(f"{word} is not JSON")

    return json.loads(text, parse_constant=refuse)


@pytest.mark.parametrize(
    "arguments",
    [
        ("kharaz-2001", "--prior", "e_n=0.98,0.01"),
        ("netl-glass-acrylic",),
        ("cross-2019", "--series", "no spin", "--series", "spin 0.225", "--separate", "mu", *LSQ),
        ("wang-2020", "--closure", "fr", *LSQ),
        ("buck-2017", "--closure", "f"),
    ],
)  # fmt: skip
def test_json_is_all_there_is_and_follows_the_schema(cli, schema, arguments):
    found = cli("fit", *arguments, "--json")
    assert (found.returncode, found.stderr) == (0, "")
    content = strict_json(found.stdout)
    schema.validate(content)
    assert content["schema"] == "ifrfit/result/1"


def test_the_command_line_is_the_library(cli):
    shown = strict_json(
        cli("fit", "kharaz-2001", "--prior", "e_n=0.98,0.01", "--gamma-min", "15", "--json").stdout
    )
    called = ifrfit.fit("kharaz-2001", prior={"e_n": (0.98, 0.01)}, gamma_min=15.0).to_dict()
    for name in PASSING:
        shown.pop(name), called.pop(name)
    assert shown == json.loads(json.dumps(called))


def test_exact_is_the_default_and_states_its_prior_of_the_noise(cli):
    content = strict_json(cli("fit", "kharaz-2001", "--prior", "e_n=0.98,0.01", "--json").stdout)
    assert content["method"] == "exact"
    assert content["fit"]["log_evidence"] is not None
    low, high = content["noise"]["prior"]["factor"]
    assert low < content["noise"]["estimates"]["factor"]["value"] < high
    assert len(content["state"]["sample"]["kappa"]) == 2000


def test_two_files_with_a_constant_of_their_own_tell_whether_they_share_it(cli, impacts):
    for name, mu in (("dry", 0.12), ("wet", 0.12), ("oiled", 0.05)):
        path = impacts(gamma=range(5, 85, 5), sigma=0.03, noise=0.03, series=name, mu=mu)
        path.rename(f"{name}.csv")
    options = ("--separate", "mu", "--fix", "e_n=0.94")
    alike = cli("fit", "dry.csv", "wet.csv", *options)
    assert (alike.returncode, alike.stderr) == (0, "")
    assert "mu [dry]" in alike.stdout
    assert "mu [wet]" in alike.stdout
    assert "  ok    the data favour one mu for all series over separate mu by a factor " in alike.stdout
    apart = cli("fit", "dry.csv", "oiled.csv", *options)
    assert "  ok    the data favour separate mu over one mu for all series by a factor " in apart.stdout


@pytest.mark.parametrize("form", ["--json", "--quiet"])
def test_intervals_where_no_table_is_printed_are_refused(cli, form):
    found = cli("fit", "kharaz-2001", "--intervals", form)
    assert (found.returncode, found.stdout) == (2, "")
    assert found.stderr == f"ifrfit: --intervals prints a table, {form} none: keep one.\n"


def test_the_command_is_recorded(cli, monkeypatch):
    monkeypatch.setattr("sys.argv", ["/somewhere/ifrfit", "fit", "kharaz-2001", "--series", "a b"])
    content = strict_json(cli("fit", "kharaz-2001", "--json").stdout)
    assert content["command"] == "ifrfit fit kharaz-2001 --series 'a b'"


@pytest.mark.usefixtures("small_page")
def test_quiet_says_nothing_and_still_writes(cli):
    found = cli("fit", "kharaz-2001", "--quiet", "--out", "results")
    assert (found.returncode, found.stdout, found.stderr) == (0, "", "")
    assert sorted(path.name for path in Path("results").iterdir()) == OWN


@pytest.mark.usefixtures("small_page")
def test_json_and_out_are_the_same_numbers(cli):
    shown = cli("fit", "kharaz-2001", "--json", "--out", "results").stdout
    assert shown == Path("results/result.json").read_text(encoding="utf-8")


def test_an_earlier_result_is_refused_before_the_data_are_read(cli):
    Path("results").mkdir()
    Path("results/result.json").write_text("{}", encoding="utf-8")
    assert cli("fit", "nix.csv", "--out", "results").returncode == 2


@pytest.mark.usefixtures("small_page")
def test_refused_data_leave_an_earlier_result_alone_even_with_force(cli):
    assert cli("fit", "kharaz-2001", "--quiet", "--out", "results").returncode == 0
    earlier = Path("results/result.json").read_bytes()
    Path("bad.csv").write_text("gamma_deg,beta\n10,x\n", encoding="utf-8")
    assert cli("fit", "bad.csv", "--out", "results", "--force").returncode == 3
    assert Path("results/result.json").read_bytes() == earlier
    assert sorted(path.name for path in Path().iterdir()) == ["bad.csv", "results"]


def test_the_template_can_be_fitted_once_its_examples_are_uncommented(cli):
    for raw in ((), ("--raw",)):
        lines = cli("template", *raw).stdout.splitlines()
        header = max(i for i, line in enumerate(lines) if not line.startswith("#"))
        text = "\n".join(line if i <= header else line.removeprefix("#") for i, line in enumerate(lines))
        Path("mine.csv").write_text(text + "\n", encoding="utf-8")
        found = cli("fit", "mine.csv")
        assert (found.returncode, found.stderr) == (0, "")
        assert "mine.csv" in found.stdout


def test_the_template_alone_is_refused_as_empty(cli):
    Path("mine.csv").write_text(cli("template").stdout, encoding="utf-8")
    found = cli("fit", "mine.csv")
    assert found.returncode == 3
    assert "there is a header, but no row under it" in found.stderr


def test_a_spreadsheet_of_the_usual_kind(cli):
    """Excel in German: title, semicolons, decimal commas, Latin-1, Windows line ends, angle from the wall."""
    lines = ["Stöße, 12.3.;;;", "Winkel zur Wand [°];β [-];σ_β [-];note"]
    shown = ifrfit.rebound(range(5, 85, 5), e_n=0.94, e_t=-0.9, mu=0.12, degrees=True)
    for angle, beta in zip(range(5, 85, 5), shown.beta.tolist(), strict=True):
        lines.append(f"{90 - angle},0;{beta:.6f};0,01;".replace(".", ","))
    lines[1] = lines[1].replace("β", "beta").replace("σ", "sigma")
    Path("Messung.csv").write_bytes("\r\n".join(lines).encode("latin-1"))
    found = cli(
        "fit",
        "Messung.csv",
        "--convention",
        "angle=Winkel zur Wand [°]:from-wall",
        "--fix",
        "e_n=0.94",
        "--method",
        "lsq",  # data without noise: the optimum is the truth
        "--json",
    )
    assert (found.returncode, found.stderr) == (0, "")
    constants = strict_json(found.stdout)["constants"]
    assert constants["e_t"]["value"] == pytest.approx(-0.9, abs=1e-5)
    assert constants["mu"]["value"] == pytest.approx(0.12, abs=1e-5)


def test_a_scene_says_what_hit_what(cli, impacts):
    data = impacts(gamma=[5.0, 15.0, 25.0, 40.0, 55.0, 70.0, 80.0], noise=0.01, sigma=0.01)
    scene = Path("scene.toml")
    bodies = '[sphere]\ndiameter_mm = 5\nmaterial = "alumina"\n[wall]\nmaterial = "soda-lime-glass"\n'
    scene.write_text(bodies, encoding="utf-8")
    content = strict_json(cli("fit", data, "--scene", scene, "--json").stdout)
    assert content["scene"]["origin"] == "scene.toml"
    assert {line["effect"] for line in content["effects"] if line["met"] is not None} == {"compliance"}
    assert "effects" not in strict_json(cli("fit", data, "--json").stdout)
    found = cli("compare", data, "--scene", scene, "--no-loo", "--closure", "ifr", "--closure", "fr")
    assert found.returncode == 0
    assert "by its conditions the scene calls for compliance: psi_1" in " ".join(found.stdout.split())


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("[wall]\n", "scene.toml: sphere.diameter_mm is missing."),
        ("[sphere]\ndiameter_mm = 20\n", "the diameter is 20 mm, but that of kharaz-2001 is 5 mm."),
        ("[sphere]\ndiameter_mm = 5\ninertia_factor = 0.5\n", "but the fit takes 0.4."),
        (None, "scene.toml: there is no such file."),
    ],
)
def test_a_scene_that_does_not_fit_is_refused(cli, text, says):
    if text is not None:
        Path("scene.toml").write_text(text, encoding="utf-8")
    found = cli("fit", "kharaz-2001", "--scene", "scene.toml", "--out", "results")
    assert found.returncode == 3
    assert found.stdout == ""
    assert says in found.stderr
    assert not Path("results").exists()
