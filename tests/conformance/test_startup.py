"""A reboot: the link drops, the parameters stay, and the start-up begins anew."""

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from tests.support.sitl_client import Client, open_ground, ready


def test_after_a_reboot_all_begins_anew() -> None:
    client = ready(open_ground())
    client.send(mavlink.MAVLink_param_set_message(1, 1, b"WP_SPEED", 1.5, 9))
    assert client.ask(246, 1) == 4
    assert client.ask(400, 0) == 0
    client.command(246, 1)
    client.run_for(0.1)
    assert client.link.dropped
    again = Client(client.simulator)
    again.run_for(30.0)
    assert again.of("EKF_STATUS_REPORT")[-1].flags == 167
    assert again.arm() == 0
    assert again.of("ATTITUDE")[0].time_boot_ms == 3000
    again.send(mavlink.MAVLink_param_request_read_message(1, 1, b"WP_SPEED", -1))
    again.run_for(0.1)
    assert again.of("PARAM_VALUE")[-1].param_value == 1.5
