"""Weather.msg has the typed rows of the table of weather parameters; what follows it needs no test of its own."""

from simbev_ros.config.weather import WEATHER_PARAMETERS, message_field
from simbev_ros.foundation.installation.interface_files import interface_folder

WORDS = {"%": "percent: ", "°": "rad, ", "m": "m, ", "": ""}


def test_the_message_has_the_rows_of_the_table() -> None:
    text = (interface_folder("simbev_interfaces") / "msg" / "Weather.msg").read_text(encoding="utf-8")
    lines = [line.partition("#") for line in text.splitlines() if line.startswith("float64")]
    found = [f"{field.strip()}  # {comment.strip()}" for field, _, comment in lines]
    rows = [(name, row) for name, row in WEATHER_PARAMETERS.items() if row.typed]
    expected = [f"float64 {message_field(name)}  # {WORDS[row.unit]}{row.meaning}" for name, row in rows]
    assert found == expected, "write these lines into interfaces/msg/Weather.msg:\n" + "\n".join(expected)
