"""What is said of where the page is."""

from __future__ import annotations

import ipaddress

import pytest

from companion.cli import web
from companion.cli.web import own_address, served
from companion.viewer.web_process import WebPlace

TOKEN = "a/long token"


def test_a_person_can_open_what_is_printed_on_another_device(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(web, "own_address", lambda: "192.168.1.7")
    told = served(WebPlace("0.0.0.0", 8000, TOKEN), to_person=True)
    assert told.startswith("the run is shown at http://192.168.1.7:8000/#token=a%2Flong%20token, for all who")


def test_a_log_file_gets_no_token() -> None:
    assert "long" not in served(WebPlace("10.0.0.1", 8000, TOKEN), to_person=False)


def test_without_a_network_the_address_stays_as_it_was_given(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(web, "own_address", lambda: None)
    assert "http://0.0.0.0:8000/" in served(WebPlace("0.0.0.0", 8000, TOKEN), to_person=False)


def test_the_own_address_is_one_of_this_computer() -> None:
    own = own_address()
    assert own is None or not ipaddress.ip_address(own).is_unspecified
