"""Forms in which the world is recorded: tables always, messages on request."""

import pytest
from pydantic import ValidationError

from simbev_ros.config.scenario import Recording


def test_tables_are_the_only_form_unless_configured() -> None:
    assert Recording().forms == ("tables",)


@pytest.mark.parametrize("forms", [["tables", "messages"], ["messages", "tables"], ["tables"]])
def test_messages_come_in_addition(forms: list[str]) -> None:
    assert Recording.model_validate({"forms": forms}).forms == tuple(forms)


@pytest.mark.parametrize("forms", [[], ["messages"], ["tables", "tables"]])
def test_a_bag_without_tables_or_with_a_form_twice_is_refused(forms: list[str]) -> None:
    with pytest.raises(ValidationError, match=r"forms: allowed are \[tables\] and \[tables, messages\]"):
        Recording.model_validate({"forms": forms})


def test_an_unknown_form_is_refused_with_those_that_are_allowed() -> None:
    with pytest.raises(ValidationError, match="'tables' or 'messages'"):
        Recording.model_validate({"forms": ["tables", "topics"]})
