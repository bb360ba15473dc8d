"""The explorer's server: who may ask, and for what."""

import socket

import pytest

import pellicle as pl
from pellicle.explorer import server
from pellicle.explorer.session import Session

testclient = pytest.importorskip("starlette.testclient", reason="the extra explore is not installed")

TOKEN, PORT = "k" * 32, 8765


@pytest.fixture(scope="module")
def client():
    session = Session(pl.Scene(pl.Layer("SiO2", 100.0), "Si"), title="<b>film</b>")
    application = server.application(session, TOKEN, PORT)
    with testclient.TestClient(application, base_url=f"http://127.0.0.1:{PORT}") as client:
        yield client


OWN = {"X-Pellicle-Token": TOKEN}


def test_the_token_opens_page_and_requests(client):
    page = client.get("/", params={"token": TOKEN})
    assert page.status_code == 200
    assert TOKEN not in page.text  # nor anything of the scene, before a request with the token
    assert "<b>film" not in page.text
    policy = page.headers["content-security-policy"]
    assert "default-src 'none'" in policy
    assert "frame-ancestors 'none'" in policy
    nonces = {client.get("/", params={"token": TOKEN}).headers["content-security-policy"] for _ in range(2)}
    assert len(nonces) == 2
    answer = client.post("/api/scene", json={}, headers=OWN)
    assert answer.json()["kind"] == "spectrum"
    assert answer.headers["cache-control"] == "no-store"


@pytest.mark.parametrize("token", ["", "x", TOKEN[:-1], TOKEN + "k", "é" * 32, TOKEN.upper()])
def test_a_wrong_token_is_refused(client, token):
    header = {"X-Pellicle-Token": token.encode()} if token else {}
    for answer in (
        client.get("/", params={"token": token}),
        client.get("/"),
        client.post("/api/scene", json={}, headers=header),
        client.post(f"/api/scene?token={TOKEN}", json={}),  # a link must not act
        client.post("/api/scene", json={}, headers={"Cookie": f"token={TOKEN}"}),
    ):
        assert answer.status_code == 403
        assert "token" in answer.text
        assert TOKEN not in answer.text


@pytest.mark.parametrize("host", ["evil.test", f"evil.test:{PORT}", "127.0.0.1", f"127.0.0.1:{PORT + 1}"])
def test_another_host_is_refused_even_with_the_token(client, host):
    assert client.post("/api/scene", json={}, headers={**OWN, "Host": host}).status_code == 421
    assert client.get("/", params={"token": TOKEN}, headers={"Host": host}).status_code == 421


def test_localhost_is_this_machine(client):
    headers = {**OWN, "Host": f"localhost:{PORT}"}
    assert client.post("/api/fit_status", json={}, headers=headers).status_code == 200


@pytest.mark.parametrize(
    ("content", "status", "said"),
    [
        (b"{", 400, "must be JSON"),
        (b"\xff\xfe", 400, "must be JSON"),
        (b"[" * 100_000, 400, "must be JSON"),
        (b"[1]", 200, "JSON object"),
        (b"null", 200, "JSON object"),
        (b'{"values": {"thickness": NaN}}', 200, "must be a number"),
    ],
)
def test_bad_bodies_are_answered_by_a_sentence(client, content, status, said):
    answer = client.post("/api/view", content=content, headers=OWN)
    assert answer.status_code == status
    assert said in answer.json()["error"]


def test_a_large_body_is_refused_before_it_is_read_whole(client, monkeypatch):
    monkeypatch.setattr(server, "LARGEST_BODY", 1000)
    answer = client.post("/api/data", content=b"x" * 1001, headers=OWN)
    assert answer.status_code == 413
    assert "larger" in answer.json()["error"]


@pytest.mark.parametrize("path", ["/etc/passwd", "/../../etc/passwd", "/%2e%2e/pyproject.toml", "/static/x"])
def test_there_are_no_files(client, path):
    assert client.get(path, params={"token": TOKEN}, headers=OWN).status_code in (404, 405)


def test_requests_are_posted(client):
    assert client.get("/api/scene", headers=OWN).status_code == 405


@pytest.mark.parametrize("port", [80_000, -1])
def test_a_port_that_cannot_be_opened_is_named(port, refuses):
    session = Session(pl.Scene(pl.Layer("SiO2", 100.0), "Si"))
    refuses(ValueError, f"port {port} cannot be opened", server.serve, session, port)


class NoStop:
    """A session that answers at once."""

    def answer(self, request, body):
        return {"request": request, "body": body}


@pytest.fixture
def served(monkeypatch):
    """The address of a server that waits a tenth of a second for a request."""
    monkeypatch.setattr(server, "SLOWEST", 0.1)
    address = server.serve_beside(NoStop(), server.explorer_page)
    port = int(address.split(":")[2].partition("/")[0])
    return port, address.partition("token=")[2]


def test_half_a_request_ends_and_a_client_that_hangs_up_leaves_no_traceback(served, caplog, capfd):
    port, token = served
    head = f"POST /api/scene HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\n"
    body = f"X-Pellicle-Token: {token}\r\nContent-Length: 100\r\n\r\n{{"
    for sent, answered in ((head, b""), (head + body, b"HTTP/1.1 408")):
        with socket.create_connection(("127.0.0.1", port), timeout=20) as connection:
            connection.sendall(sent.encode())
            received = b"".join(iter(lambda: connection.recv(4096), b""))  # until the server closes it
            assert received.startswith(answered) if answered else not received
    with socket.create_connection(("127.0.0.1", port), timeout=20) as connection:
        connection.sendall((head + body).encode())
    with socket.create_connection(("127.0.0.1", port), timeout=20) as connection:
        whole = body.replace("Content-Length: 100", "Content-Length: 2") + "}"
        connection.sendall((head + whole).encode())
        assert connection.recv(4096).startswith(b"HTTP/1.1 200")
    assert "Traceback" not in caplog.text + capfd.readouterr().err
