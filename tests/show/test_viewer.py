"""A mechanism posed by sliders."""

import json
from contextlib import contextmanager
from http.client import HTTPConnection
from threading import Thread

import numpy as np
import pytest

import ephs
from ephs.show.motions.viewer import Posed, served
from tests.scenes import shipped

URDF = """<robot name="arm"><link name="base"/>
<link name="rod"><inertial><mass value="1"/><origin xyz="0.5 0 0"/>
<inertia ixx="0.01" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="pin" type="revolute"><parent link="base"/><child link="rod"/><axis xyz="0 1 0"/>
<limit lower="-1" upper="2" effort="1" velocity="1"/></joint></robot>"""


@contextmanager
def serving(scene):
    """What is posed, and the port of its server."""
    posed = Posed(shipped(scene), ephs.load)
    server = served(posed)
    Thread(target=server.serve_forever, daemon=True).start()
    try:
        yield posed, int(server.server_address[1])
    finally:
        server.shutdown()
        server.server_close()


def asked(port, method, path, body=None, **headers):
    connection = HTTPConnection("127.0.0.1", port, timeout=60.0)
    connection.request(method, path, body, headers)
    answer = connection.getresponse()
    return answer.status, answer.read().decode()


@pytest.mark.parametrize(("scene", "joint"), [("four-bar", "main"), ("chain", "j0")])
def test_a_slider_moves_the_mechanism_as_another_state_would(scene, joint):
    with serving(scene) as (posed, port):
        before = posed.scene
        status, text = asked(port, "POST", "/pose", json.dumps({joint: [0.4]}))
    assert status == 200
    found, wanted = json.loads(text), before.with_state({joint: 0.4}, adjust=True)
    assert found["coordinates"][joint] == [0.4]
    np.testing.assert_allclose(
        found["poses"], np.concatenate([body.pose for _, body in wanted.all_bodies()]), atol=1e-12
    )
    assert abs(np.array(found["poses"]) - np.concatenate([body.pose for _, body in before.all_bodies()])).max() > 0.01


def test_faults_are_told_and_change_nothing():
    with serving("four-bar") as (posed, port):
        before = posed.scene
        status, text = asked(port, "POST", "/pose", json.dumps({"mian": [0.4]}))
        assert status == 400 and "main" in text
        assert asked(port, "POST", "/pose", "no numbers")[0] == 400
        status, text = asked(port, "POST", "/model?name=arm.urdf", "<robot>")
        assert status == 400 and "arm.urdf" in text
        assert asked(port, "POST", "/elsewhere", "")[0] == asked(port, "GET", "/elsewhere")[0] == 404
        assert posed.scene is before


def test_a_dropped_model_is_shown():
    with serving("four-bar") as (posed, port):
        assert asked(port, "POST", "/model?name=../../arm.urdf", URDF)[0] == 200
        assert posed.scene.joint("pin").kind == "revolute"
        status, page = asked(port, "GET", "/")
    *_, slider = json.loads(page.split('id="view">')[1].split("</script>")[0])["joints"]
    assert status == 200 and "limits of: pin" in page
    assert (slider["label"], slider["low"], slider["high"], slider["unit"]) == ("pin", -np.pi, np.pi, "rad")


@pytest.mark.parametrize("headers", [{"Host": "example.org"}, {"Origin": "http://example.org"}])
def test_pages_of_elsewhere_are_refused(headers):
    with serving("four-bar") as (_, port):
        assert asked(port, "GET", "/", **headers)[0] == 403
        assert asked(port, "POST", "/pose", "{}", **headers)[0] == 403
