"""What is refused, and in which words: file, line, column, remedy, in one or two sentences."""

from __future__ import annotations

import re

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import ifrfit.data as data
from ifrfit.errors import DataError

LONG = "series,observable,gamma_deg,value\n"

CASES = {
    "empty": ("", "x.csv: the file is empty. 'ifrfit template' prints a table to fill in."),
    "comments only": ("# gamma_deg,beta\n\n", "x.csv: the file is empty. 'ifrfit template' prints"),
    "header only": (
        "gamma_deg,beta\n",
        "x.csv: there is a header, but no row under it. Add one impact a line.",
    ),
    "binary": (b"\x00\x01\x02\x03", "x.csv: the file is binary, not a text table. Export it as CSV."),
    "spreadsheet": (b"PK\x03\x04abc", "x.csv: the file is a spreadsheet or an archive, not a text table."),
    "compressed": (b"\x1f\x8b\x08abc", "x.csv: the file is compressed, not a text table."),
    "no header": ("10,0.4\n20,0.3\n", "x.csv, line 1: there is no header, the file begins with numbers."),
    "header as comment": ("# gamma_deg,beta\n10,0.4\n", "without '#': for example gamma_deg, beta."),
    "text in a number": (
        "gamma_deg,beta,sigma\n10,0.4,0.1\n20,abc,0.1\n",
        "x.csv, line 3, column beta: 'abc' is not a number. Correct it, or leave the cell empty for",
    ),
    "text behind comments": (
        "# one\ngamma_deg,beta\n# two\n\n10,4e\n",
        "x.csv, line 5, column beta: '4e' is not",
    ),
    "underscore": ("gamma_deg,beta\n10,1_0\n", "x.csv, line 2, column beta: '1_0' is not a number."),
    "thousands": ("gamma_deg;beta\n10;1.234,5\n", "x.csv, line 2, column beta: '1.234,5' is not a number."),
    "infinity": ("gamma_deg,beta\n10,-inf\n", "x.csv, line 2, column beta: '-inf' is infinite. Correct it"),
    "overflow": ("gamma_deg,beta\n10,1e999\n", "x.csv, line 2, column beta: '1e999' is infinite."),
    "two decimal signs": (
        "gamma_deg;beta\n10,5;0,1\n20;0.4\n",
        "x.csv, line 3, column beta: '0.4' has a decimal point, line 2 in column gamma_deg a decimal comma.",
    ),
    "missing angle": (
        "beta\n0.4\n",
        "x.csv: there is no incidence angle, which beta needs. Add a column gamma_deg",
    ),
    "missing observable": (
        "gamma_deg,sigma\n10,0.1\n",
        "x.csv: no column of an observable. Add one, such as beta",
    ),
    "missing value": ("observable,gamma_deg\nbeta,1\n", "there is a column observable but no column value."),
    "missing observable column": (
        "value,gamma_deg\n1,1\n",
        "there is a column value but no column observable.",
    ),
    "unknown column": (
        "gamma_deg,betta\n10,0.4\n",
        "x.csv, line 1, column betta: unknown name, the closest known one is beta. Rename it, say",
    ),
    "nothing known": (
        "foo,bar\n1,2\n",
        "x.csv, line 1: 2 columns have unknown names, foo, bar. Say what a column holds, --convention "
        "column:NAME=foo, or leave columns out, --convention ignore=foo,bar.",
    ),
    "one unknown": (
        "gamma_deg,beta,Ort\n1,1,1\n",
        "column Ort: unknown name. Rename it, say what it holds, --convention column:NAME=Ort, or leave it "
        "out, --convention ignore=Ort.",
    ),
    "number of the impact": (
        "shot,gamma_deg,beta\n1,1,1\n",
        "column shot: unknown name, the closest known one is impact_id. Rename it, say what it holds, "
        "--convention column:impact_id=shot,",
    ),
    "angle in the user's language": (
        "Winkel zur Wand [°],beta\n1,1\n",
        "column Winkel zur Wand [°]: unknown name. If it is the incidence angle, say --convention "
        "'angle=Winkel zur Wand [°]:from-wall' (or from-normal); otherwise name it, --convention "
        "'column:NAME=Winkel zur Wand [°]', or leave it out, --convention 'ignore=Winkel zur Wand [°]'.",
    ),
    "angle among several unknown": (
        "Ort,Winkel_deg,beta\n1,1,1\n",
        "Say what a column holds, --convention angle=Winkel_deg:from-wall, or leave",
    ),
    "many unknown": (
        ",".join([f"measured quantity no {i}" for i in range(25)] + ["gamma_deg"]) + "\n" + "1," * 25 + "1\n",
        "line 1: 25 columns have unknown names, measured quantity no 0, measured quantity no 1, measured "
        "quantity no 2, measured quantity no 3 and 21 more. Say what a column holds, --convention "
        "'column:NAME=measured quantity no 0', or leave columns out, --convention 'ignore=measured quantity "
        "no 0,measured quantity no 1' and so on.",
    ),
    "unknown with a comma": (
        'a;"b, c";beta\n1;1;1\n',
        "leave columns out, --convention ignore=a and so on.",
    ),
    "separated by blanks": (
        "gamma_deg beta\n10 0.4\n",
        "columns are separated by commas, semicolons or tabs.",
    ),
    "column without name": (
        "gamma_deg,,beta\n10,1,0.4\n",
        "x.csv, line 1, column 2: the column has no name.",
    ),
    "duplicate header": (
        "gamma_deg,beta,Beta\n1,1,1\n",
        "x.csv, line 1: columns 2 and 3 are both called 'Beta'.",
    ),
    "two units of one": (
        "gamma_deg,delta_deg,delta_rad\n10,20,0.1\n",
        "delta_deg and delta_rad both give delta_deg",
    ),
    "long line": (
        "gamma_deg,beta\n10,0.4,3\n",
        "x.csv, line 2, column 3: the line goes on, 3 cells under a header of 2",
    ),
    "decimal commas behind commas": (
        "gamma_deg,beta\n10,5,0,4\n",
        "if the numbers have decimal commas, separate",
    ),
    "short line": (
        "gamma_deg,beta\n10,0.4\n20\n",
        "x.csv, line 3, column beta: the line ends before it, 1 cell under a header of 2. Complete the line",
    ),
    "unclosed quote": (
        'gamma_deg,beta\n10,"0.4\n20,0.3\n',
        "x.csv, line 2: cannot be read (unexpected end of data)",
    ),
    "empty quotes": ('""\n', "x.csv: the file is empty."),
    "200,000 digits": (
        "gamma_deg,beta\n10,0." + "1" * 200_000 + "\n",
        "x.csv, line 2, column beta: '0.111111111111111111...' (200002 characters) is longer than any number",
    ),
    "200,000 digits in the first column": (
        "gamma_deg,beta\n" + "1" * 200_000 + ",0.4\n",
        "line 2, column gamma_deg",
    ),
    "sigma 0": (
        "gamma_deg,beta,sigma\n10,0.4,0\n",
        "x.csv, line 2, column sigma: 0 cannot be a standard uncertainty.",
    ),
    "sigma negative": (
        "gamma_deg,beta,sigma_beta\n10,0.4,-1\n",
        "line 2, column sigma_beta: -1 cannot be a standard",
    ),
    "sigma tiny": (
        "gamma_deg,beta,sigma\n10,0.4,1e-300\n",
        "1e-300 is impossible for a standard uncertainty",
    ),
    "sigma huge": ("gamma_deg,beta,sigma\n10,0.4,1e300\n", "1e+300 is impossible for a standard uncertainty"),
    "sigma of gamma": ("gamma_deg,beta,sigma_gamma_deg\n10,0.4,-1\n", "column sigma_gamma_deg: -1 cannot be"),
    "value tiny": (
        "gamma_deg,beta\n10,1e-300\n",
        "x.csv, line 2, column beta: 1e-300 is impossible for beta",
    ),
    "value huge": (
        "gamma_deg,beta\n10,-1e300\n",
        "x.csv, line 2, column beta: -1e+300 is impossible for beta",
    ),
    "value huge, long": (
        LONG + "a,e_n,10,1e300\n",
        "x.csv, line 2, column value: 1e+300 is impossible for e_n (0 to 10)",
    ),
    "negative e_n": ("gamma_deg,e_n\n10,-0.1\n", "line 2, column e_n: -0.1 is impossible for e_n"),
    "delta beyond 90": (
        "gamma_deg,delta_deg\n10,95\n",
        "column delta_deg: 95 degrees is impossible for delta_deg",
    ),
    "gamma above": (
        "gamma_deg,beta\n91,0.4\n",
        "line 2, column gamma_deg: the incidence angle comes to 91 degrees",
    ),
    "gamma below": (
        "gamma_deg,beta\n-1,0.4\n",
        "the incidence angle comes to -1 degrees from the normal, outside 0 to 90.",
    ),
    "spin huge": (
        "gamma_deg,beta,spin_y\n1,0.4,1e300\n",
        "column spin_y: 1e+300 is impossible for a spin R omega/u",
    ),
    "speed 0": (
        "gamma_deg,beta,speed_m_s\n1,0.4,0\n",
        "column speed_m_s: 0 m/s is impossible for an incoming speed",
    ),
    "speed without unit": (
        "gamma_deg,beta,speed\n1,0.4,2\n",
        "line 1, column speed: no unit. Put one into the header, for example speed_m_s, or say --convention "
        "unit:speed=m/s.",
    ),
    "unknown unit": (
        "gamma [grad],beta\n10,0.4\n",
        "x.csv, line 1, column gamma [grad]: the unit 'grad' does not fit",
    ),
    "unit of another kind": (
        "gamma [mm],beta\n10,0.4\n",
        "the unit 'mm' does not fit here. Known are: deg, rad.",
    ),
    "unit of a number": (
        "gamma_deg,beta [deg]\n10,0.4\n",
        "the unit 'deg' does not fit here. Known are: none.",
    ),
    "degrees or radians": (
        "gamma,beta\n1,0.4\n",
        "column gamma: could be in degrees or in radians. Call it gamma_deg or gamma_rad, or say "
        "--convention unit:gamma=deg.",
    ),
    "degrees or radians of a name with blanks": (
        "angle from wall,beta\n1,0.4\n",
        "or say --convention 'unit:angle from wall=deg'.",
    ),
    "unknown observable": (
        LONG + "a,betta,10,1\n",
        "x.csv, line 2, column observable: 'betta' is no observable, the closest",
    ),
    "empty observable": (
        LONG + "a,,10,1\n",
        "x.csv, line 2, column observable: '' is no observable. Known are",
    ),
    "unknown provenance": (
        "gamma_deg,beta,provenance\n1,1,guessed\n",
        "line 2, column provenance: 'guessed' is no provenance.",
    ),
    "ambiguous angle": (
        "theta,beta\n10,0.4\n",
        "column theta: could be measured from the wall or from its normal. Say which: --convention "
        "angle=from-wall or --convention angle=from-normal",
    ),
    "ambiguous angle of a name with blanks": (
        "alpha [°],beta\n10,0.4\n",
        "column alpha [°]: could be measured from the wall or from its normal. Say which: --convention "
        "angle=from-wall or --convention angle=from-normal",
    ),
    "two angles with blanks": (
        "alpha [°],theta [°],beta\n10,10,0.4\n",
        "Name it: --convention 'angle=alpha [°]:from-wall'",
    ),
    "two angles": (
        "alpha_deg,theta,beta\n10,10,0.4\n",
        "x.csv: two columns could be the incidence angle, 'alpha_deg' and 'theta'. Name it: --conv",
    ),
    "mixed angles": ("gamma_deg,alpha_deg,beta\n10,80,0.4\n", "two columns could be the incidence angle"),
    "e_t": (
        "gamma_deg,e_t\n10,0.4\n",
        "column e_t: could be v_t'/v_t of the centre (= -beta_cm) or the closure constant",
    ),
    "psi": (
        "gamma_deg,psi_deg\n10,4\n",
        "column psi_deg: could be taken over the incoming or the outgoing normal",
    ),
    "mixed psi": (
        LONG + "a,tan_psi_after,10,1\na,tan_psi,20,1\n",
        "x.csv, line 3, column observable: 'tan_psi': could be",
    ),
    "magnitude": (
        "gamma_deg,|beta|\n10,0.4\n",
        "a magnitude without its sign fits two mirror-image solutions",
    ),
    "magnitude, long": (
        LONG + "a,abs_beta,10,1\n",
        "line 2, column observable: 'abs_beta': a magnitude without its sign",
    ),
    "long and wide": (
        "observable,value,beta,gamma_deg\nbeta,1,1,1\n",
        "column beta: the table also has the columns of a long",
    ),
    "sigma of several": (
        "gamma_deg,beta,e_n,sigma\n1,1,1,1\n",
        "column sigma: could belong to any of beta, e_n. Call it sigma_beta",
    ),
    "sigma of nothing": (
        "gamma_deg,beta,sigma_e_n\n1,1,1\n",
        "the uncertainty of e_n, which the table does not have.",
    ),
    "sigma twice": (
        "gamma_deg,beta,sigma,sigma_beta\n1,1,1,1\n",
        "sigma and sigma_beta both give an uncertainty of beta.",
    ),
    "sd without n": ("gamma_deg,beta,sd\n1,1,1\n", "column sd: the deviation of repeats needs their number."),
    "sd and sigma": ("gamma_deg,beta,sd,n,sigma\n1,1,1,2,1\n", "sigma and sd both give an uncertainty."),
    "half a repeat": ("gamma_deg,beta,n\n1,1,2.5\n", "line 2, column n: 2.5 is not a number of repeats."),
}

UNDEFINED = {
    "beta at rest": (
        "gamma_deg,beta\n10,1\n0,0.4\n",
        "x.csv, line 3, column beta: the contact point does not move",
    ),
    "beta nearly at rest": ("gamma_deg,beta\n1e-12,0.4\n", "the contact point does not move"),
    "beta rolling": (
        "gamma_deg,spin_y,beta\n30,-0.5,0.4\n",
        "line 2, column beta: the contact point does not move",
    ),
    "beta_cm": (
        "gamma_deg,spin_y,beta_cm\n0,1,0.4\n",
        "column beta_cm: at gamma = 0 there is no tangential velocity",
    ),
    "mu_app": (
        "gamma_deg,mu_app\n90,0.4\n",
        "column mu_app: at gamma = 90 degrees there is no normal velocity",
    ),
    "tan_psi_after": (
        "gamma_deg,tan_psi_after\n90,0.4\n",
        "at gamma = 90 degrees there is no normal velocity",
    ),
    "tan_psi_out": ("gamma_deg,tan_psi_out\n90,0.4\n", "at gamma = 90 degrees there is no normal velocity"),
    "psi_after": ("gamma_deg,psi_after_deg\n90,4\n", "at gamma = 90 degrees there is no normal velocity"),
    "delta": ("gamma_deg,delta_deg\n90,4\n", "at gamma = 90 degrees there is no normal velocity"),
    "e_n": ("gamma_deg,e_n\n90,0.9\n", "at gamma = 90 degrees there is no normal velocity"),
    "lambda": ("gamma_deg,lambda_deg\n0,4\n", "at gamma = 0 without spin nothing moves along the wall"),
    "long": (LONG + "a,mu_app,90,1\n", "x.csv, line 2, column value: mu_app: at gamma = 90 degrees"),
}


def refusal(tmp_path, text, **options):
    path = tmp_path / "x.csv"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(DataError) as caught:
        data.read(path, **options)
    assert caught.value.exit_status == 3
    return str(caught.value).replace(f"{tmp_path}/", "")


def sentences(message):
    return len(re.findall(r"[.!?](?=\s+[A-Z'-]|$)", message.replace("v_t'/v_t", ""))) or 1


@pytest.mark.parametrize("name", [*CASES, *UNDEFINED])
def test_refusal_names_place_and_remedy(tmp_path, name):
    text, expected = {**CASES, **UNDEFINED}[name]
    message = refusal(tmp_path, text)
    assert expected in message
    assert message.startswith("x.csv")
    assert sentences(message) <= 2
    assert len(message) < 500


@pytest.mark.parametrize(
    "text",
    [
        "gamma_deg,spin_y,beta\n0,0.1,0.4\n",  # spin moves the contact point
        "gamma_deg,beta\n90,0.4\n",
        "gamma_deg,beta_cm\n90,0.4\n",
        "gamma_deg,spin_x,lambda_deg\n0,0.2,-90\n",
        "gamma_deg,beta_tot\n90,0.4\n",
        "gamma_deg,beta_tot\n0,0.4\n",
        "gamma_deg,psi_after_deg\n0,0\n",
        "gamma_deg,v_n\n90,0\n",
        "gamma_deg,v_x\n10,5e-17\n",  # rounding of a simulation
        "gamma_deg,beta,sigma_gamma_deg\n10,0.4,0\n",  # set exactly
    ],
)
def test_what_is_defined_is_not_refused(read, text):
    assert len(read(text)) == 1


WORDS = st.sampled_from(
    [
        "gamma_deg",
        "beta",
        "observable",
        "value",
        "u_x_m_s",
        "u_z_m_s",
        "v_x_m_s",
        "psi",
        "sigma",
        "alpha",
        "n",
        "10",
        "0,5",
        "-1e5",
        "inf",
        "1e-300",
        "nan",
        "é",
        "#",
        "90",
        "0",
        "beta_[rad]",
        '"',
        "_",
        "line",
    ]
)


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None, max_examples=300)
@given(
    st.one_of(
        st.binary(max_size=200),
        st.text(max_size=200).map(lambda text: text.encode("utf-8", "surrogatepass")),
        st.tuples(st.lists(st.lists(WORDS, max_size=5), max_size=5), st.sampled_from(",;\t")).map(
            lambda t: "\n".join(t[1].join(row) for row in t[0]).encode()
        ),
    )
)
def test_whatever_a_file_holds_it_is_read_or_refused_in_words(tmp_path, raw):
    path = tmp_path / "x.csv"
    path.write_bytes(raw)
    try:
        obs = data.read(path)
    except DataError as error:
        message = str(error)
    else:
        assert np.isfinite(obs.table.value).all()
        assert obs.sources[0].rows_used == len(obs) > 0
        return
    assert message.startswith(str(path))
    assert len(message) < 800


def test_missing_file_and_folder(tmp_path):
    with pytest.raises(DataError, match=r"nix\.csv: there is no such file\. Check the name\."):
        data.read(tmp_path / "nix.csv")
    with pytest.raises(DataError, match=r"this is a folder\. Name a CSV, TSV or Parquet file in it\."):
        data.read(tmp_path)
    with pytest.raises(DataError, match="cannot be read"):
        data.read("a\0b.csv")


def test_empty_columns_to_the_right_are_no_error(read):
    assert list(read("gamma_deg;beta;;\n10;0,4;;\n20;0,3;;\n").table.value) == [0.4, 0.3]
    assert list(read("gamma_deg,beta\n10,0.4,,\n20,0.3\n").table.value) == [0.4, 0.3]


@pytest.mark.parametrize(
    ("header", "sigma"),
    [
        ("beta_err", "sigma_beta"),
        ("u_beta", "sigma_beta"),
        ("Delta_beta", "sigma_beta"),
        ("dbeta", "sigma_beta"),
        ("beta_std", "sigma_beta"),
        ("se_e_n", "sigma_e_n"),
        ("gamma_error", "sigma_gamma_deg"),
    ],
)
def test_an_uncertainty_is_never_offered_as_a_value(read, header, sigma):
    with pytest.raises(DataError) as raised:
        read(f"gamma_deg,beta,{header}\n10,-0.5,0.01\n20,-0.4,0.01\n")
    assert f"a column {sigma}" in str(raised.value)
    assert f"column:{sigma}={header}" in str(raised.value)


@pytest.mark.parametrize("code", ["-999", "-99", "9999", "-99.9"])
@pytest.mark.parametrize("column", ["beta", "gamma_deg", "spin_y", "sigma"])
def test_a_code_for_a_missing_value_is_refused_with_its_place(read, column, code):
    cells = {"gamma_deg": "20", "beta": "0.4", "spin_y": "0.1", "sigma": "0.02"}
    lines = [",".join(cells), ",".join(cells.values()), ",".join((cells | {column: code}).values())]
    with pytest.raises(DataError) as raised:
        read("\n".join(lines) + "\n")
    assert f"line 3, column {column}: {code} looks like a code for 'not measured'" in str(raised.value)
    assert "Leave such cells empty" in str(raised.value)


def test_a_number_like_a_code_among_its_like_is_none(read):
    text = "u_x_m_s,u_z_m_s,v_x_m_s,radius_m,omega_y_after_rad_s\n1,2,0.5,0.001,{}\n1,2,0.5,0.001,-150\n"
    assert read(text.format("-99")).table.value.size == 4
    assert read(text.format("-80")).table.value.size == 4


@pytest.mark.parametrize(
    ("column", "values", "words"),
    [
        ("gamma_deg", (10, 20), "has the angle 20 degrees here and 10 degrees in line 2"),
        ("spin_y", (0.1, 0.3), "has the spin 0.3 here and 0.1 in line 2"),
        ("speed_m_s", (1, 2), "has the speed 2 m/s here and 1 m/s in line 2"),
    ],
)
def test_an_impact_id_that_starts_anew_is_refused(read, column, values, words):
    cells = {"gamma_deg": 10, "beta": 0.4, "spin_y": 0.1, "speed_m_s": 1, "impact_id": 7}
    rows = [cells | {column: value} for value in values]
    text = "\n".join(",".join(map(str, row)) for row in (cells, *(row.values() for row in rows)))
    with pytest.raises(DataError, match="impact '7'") as raised:
        read(text + "\n")
    assert words in str(raised.value)
    assert "column impact_id" in str(raised.value)
    assert "Number the impacts through the whole table or remove the column." in str(raised.value)


def test_readings_of_one_impact_may_differ_a_little(read):
    text = "observable,value,gamma_deg,impact_id\nbeta_cm,-0.7,{},1\nspin_y_after,-0.4,{},1\n"
    assert len(read(text.format(20, 20.3))) == 2
    with pytest.raises(DataError, match=r"Number the impacts through the whole table\.$"):
        read(text.format(20, 21))
