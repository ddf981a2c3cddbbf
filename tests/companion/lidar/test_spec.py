"""``--lidar``: what is understood, and what is refused in one line."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.lidar.spec import LidarError, Mounting, parsed


def test_a_model_and_a_port_are_enough() -> None:
    spec = parsed("LD19:/dev/ttyUSB0")
    assert (spec.model.name, spec.port, spec.model.baud) == ("LD19", "/dev/ttyUSB0", 230400)
    assert spec.mounting == Mounting(0.02, 12.0) and spec.text == "LD19:/dev/ttyUSB0"


def test_everything_about_a_mounting() -> None:
    where = "yaw=-90,x=0.2,y=-0.1,flip,mask=170..190,mask=350..10"
    text = f"rplidar_c1:/dev/ttyUSB0:{where},min=0.3,max=8,intensity=10,empty=0"
    masked_deg = (170.0, 190.0), (350.0, 10.0)
    assert parsed(text) == parsed(text.replace(",", ", "))
    assert parsed(text).mounting == Mounting(0.3, 8.0, -90.0, 0.2, -0.1, True, masked_deg, 10, 0.0, True)


@pytest.mark.parametrize(
    ("text", "port"),
    [
        ("C1:/dev/serial/by-path/pci-0:1.0-port0", "/dev/serial/by-path/pci-0:1.0-port0"),
        ("X4:/dev/serial/by-path/pci-0:1.0-port0:flip", "/dev/serial/by-path/pci-0:1.0-port0"),
        ("A1:/dev/ttyS0:", "/dev/ttyS0"),
        ("LD-06:/dev/ttyS0", "/dev/ttyS0"),
    ],
)
def test_ports_with_colons_of_their_own(text: str, port: str) -> None:
    assert parsed(text).port == port


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("R2D2:/dev/ttyUSB0", "'R2D2' is no model; models are LD06, LD19, RPLIDAR-A1 (A1), RPLIDAR-C1 (C1), YDLIDAR"),
        ("LD19:/dev/x:yav=3", "'yav=3' is no option, did you mean yaw?"),
        ("LD19:/dev/x:yaw=1,8", "'8' is no option; decimals have a point, 1.8 and not 1,8"),
        ("LD19", "names no port; write MODEL:PORT"),
        ("LD19::yaw=1", "names no port"),
        ("LD19:/dev/x:yaw=north", "yaw=north: give a number from -360 to 360"),
        ("LD19:/dev/x:yaw=nan", "yaw=nan: give a number"),
        ("LD19:/dev/x:tilt=3", "'tilt=3' is no option; write"),
        ("LD19:/dev/x:x=1,up=2", "'up=2' is no option"),
        ("LD19:/dev/x:min=3,max=2", "min=3 is not below max=2; the LD19 sees from 0.02 to 12 m"),
        ("LD19:/dev/x:max=50", "max=50: give a number from 0.1 to 12"),
        ("LD19:/dev/x:mask=20", "mask=20: write mask=FROM..TO"),
        ("LD19:/dev/x:mask=10..10", "begins where it ends"),
        ("X4:/dev/x:intensity=3", "the YDLIDAR-X4 does not tell how strong echoes are"),
        ("LD19:/dev/x,yaw=90", "one colon stands before all options, and commas between them"),
        ("LD19:/dev/x:yaw=90:flip", "one colon stands before all options"),
        ("LD19:/dev/x:flip=maybe", "'flip=maybe' is no option"),
        ("LD19:/dev/ttyUSB9:inverted", "'inverted' is no option"),
        ("LD19:/dev/x:FLIP", "'FLIP' is no option"),
        ("LD19:/dev/x:yaw 3", "'yaw 3' is no option"),
        ("LD19:/dev/x:yaw=10,yaw=20", "yaw is given twice"),
    ],
)
def test_what_is_wrong_is_told_in_one_line(text: str, says: str) -> None:
    with pytest.raises(LidarError) as raised:
        parsed(text)
    assert says in str(raised.value) and len(str(raised.value).splitlines()) == 1


@given(st.text(alphabet="LD19:/dev=x,yawmsk.0123-einf", max_size=40))
def test_any_text_is_understood_or_refused(text: str) -> None:
    try:
        mounting = parsed(f"LD19:/dev/x:{text}").mounting
    except LidarError:
        return
    assert mounting.min_m < mounting.max_m <= 12.0
