"""The page of a recording is served under the names of this machine only."""

import http.client
import threading
from http.server import HTTPServer

import pytest

from twin.viewer import web


@pytest.fixture(scope="module")
def port(tmp_path_factory):
    path = tmp_path_factory.mktemp("web") / "a.rrd"
    path.write_bytes(b"recorded")
    with HTTPServer((web.LOOPBACK, 0), web._handler({"/": b"page"}, path)) as server:
        thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.02})
        thread.start()
        yield server.server_port
        server.shutdown()
        thread.join()


@pytest.mark.parametrize(
    ("host", "status"),
    [
        ("127.0.0.1:80", 200),
        ("localhost:9000", 200),  # behind `ssh -L 9000:...`
        ("localhost", 200),
        ("rebound.example:80", 403),
        ("localhost.example", 403),
        ("", 403),
    ],
)
@pytest.mark.parametrize("name", ["/", "/recording.rrd"])
def test_a_foreign_name_that_leads_to_this_machine_gets_nothing(port, name, host, status):
    line = http.client.HTTPConnection(web.LOOPBACK, port, timeout=10)
    line.putrequest("GET", name, skip_host=True)
    line.putheader("Host", host)
    line.endheaders()
    answer = line.getresponse()
    assert answer.status == status
    assert (answer.read() in (b"page", b"recorded")) == (status == 200)
    line.close()
