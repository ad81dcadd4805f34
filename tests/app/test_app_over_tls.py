"""The server itself, asked by curl: the transcript of section Who can reach the app, with TLS."""

import os
import re
import shutil
import signal
import subprocess
import sys

import pytest
from background import heed_ctrl_c

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(
        not (shutil.which("curl") and shutil.which("openssl")), reason="no curl or openssl here"
    ),
]
SECRET = "correct horse 9"


def start(state, *arguments):
    environment = {**os.environ, "PYTHONUNBUFFERED": "1", "LANG": "C", "TANKCAL_STATE": str(state)}
    command = [sys.executable, "-m", "tankcal", "app", "--no-browser", "--workspace", str(state)]
    process = subprocess.Popen(
        [*command, *arguments], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
        env=environment, start_new_session=True, preexec_fn=heed_ctrl_c,
    )  # fmt: skip
    line = process.stdout.readline()
    address = re.search(r"https?://[^\s;]+", line)
    assert address, line + process.stdout.read()
    return process, address.group()


def curl(*arguments):
    """Status and text of an answer with its headers."""
    done = subprocess.run(
        ["curl", "-s", "-i", "--max-time", "60", *arguments], capture_output=True, text=True,
        check=True,
    )  # fmt: skip
    return int(re.match(r"HTTP/\S+ (\d+)", done.stdout)[1]), done.stdout


@pytest.fixture
def local(tmp_path):
    process, address = start(tmp_path)
    yield address
    process.send_signal(signal.SIGINT)
    assert process.wait(30) == 0


def test_transcript_of_the_local_app(local, tmp_path):
    root, token = local.split("/?token=")
    jar = str(tmp_path / "jar")
    assert curl(f"{root}/")[0] == 403  # no token
    status, text = curl("-c", jar, local)
    assert status == 303
    assert token not in re.search(r"(?im)^location: (.*)$", text)[1]
    cookie = re.search(r"(?im)^set-cookie: (.*)$", text)[1].lower()
    assert "httponly" in cookie
    assert "samesite=strict" in cookie
    status, text = curl("-b", jar, f"{root}/")
    assert status == 200
    assert re.search(r"(?im)^content-security-policy: default-src 'self'", text)
    assert re.search(r"(?im)^x-content-type-options: nosniff", text)
    assert curl("-b", jar, "-H", "Host: evil.example", f"{root}/")[0] == 421
    for origin in ([], ["-H", "Origin: http://evil.example"], ["-H", "Origin: null"]):
        assert curl("-b", jar, *origin, "-d", "tank=x", f"{root}/new")[0] == 421
    assert curl("-b", jar, "-H", f"Origin: {root}", "-d", "kind=x", f"{root}/new")[0] == 400
    for path in ("/job/../../etc/passwd", "/static/1/..%2f..%2fguard.py", "/job/x/file/passwd"):
        status, text = curl("-b", jar, "--path-as-is", root + path)
        assert status == 404
        assert "root:" not in text
    big = tmp_path / "big"
    with big.open("wb") as file:
        file.truncate(200_000_001)
    status, _ = curl("-b", jar, "-H", f"Origin: {root}", "-H", "Expect:", "--data-binary",
                     f"@{big}", f"{root}/upload?name=big.csv")  # fmt: skip
    assert status == 413
    assert list((tmp_path / "uploads").iterdir()) == []


def test_transcript_of_an_app_with_users_behind_tls(tmp_path):
    environment = {**os.environ, "TANKCAL_STATE": str(tmp_path), "LANG": "C"}
    app = [sys.executable, "-m", "tankcal", "app"]

    def run(*arguments, given=""):
        return subprocess.run([*app, *arguments], input=given, capture_output=True, text=True,
                              env=environment, check=False)  # fmt: skip

    refused = run("--address", "0.0.0.0", "--no-browser")
    assert refused.returncode == 2
    assert "--certificate" in refused.stderr
    pem = tmp_path / "server.pem"
    subprocess.run(
        ["openssl", "req", "-x509", "-newkey", "rsa:2048", "-nodes", "-days", "2", "-subj",
         "/CN=127.0.0.1", "-keyout", str(tmp_path / "key"), "-out", str(tmp_path / "cert")],
        check=True, capture_output=True,
    )  # fmt: skip
    pem.write_text((tmp_path / "key").read_text() + (tmp_path / "cert").read_text())
    tls = ["--address", "0.0.0.0", "--certificate", str(pem)]
    refused = run(*tls, "--no-browser")
    assert refused.returncode == 2
    assert "--add-user" in refused.stderr
    for name, role in (("Ana", "surveyor"), ("Rui", "approver")):
        added = run("--add-user", name, "--role", role, given=f"{SECRET}\n")
        assert added.returncode == 0, added.stderr
    process, address = start(tmp_path, *tls)
    try:
        assert "token" not in address
        root, jar = address.rstrip("/"), str(tmp_path / "jar")
        ask = ["-k", "-b", jar, "-H", "Accept: text/html", "-H", f"Origin: {root}"]
        status, text = curl(*ask, f"{root}/")
        assert status == 303
        assert "/login?back=" in text
        assert curl(*ask, "-d", "name=Ana&password=wrong", f"{root}/login")[0] == 403
        status, text = curl(
            *ask, "-c", jar, "-d", "name=Ana", "--data-urlencode", f"password={SECRET}",
            f"{root}/login",
        )  # fmt: skip
        assert status == 303
        cookie = re.search(r"(?im)^set-cookie: (.*)$", text)[1].lower()
        assert all(item in cookie for item in ("httponly", "secure", "samesite=strict"))
        assert curl(*ask, f"{root}/")[0] == 200
        assert curl(*ask, "-d", "number=1&reason=x", f"{root}/register/withdraw")[0] == 403
        assert curl(*ask, "-H", "Host: evil.example", f"{root}/")[0] == 421
        plain = subprocess.run(["curl", "-s", "--max-time", "20", root.replace("https", "http")],
                               capture_output=True, check=False)  # fmt: skip
        assert plain.returncode != 0  # no answer without encryption
        assert curl(*ask, "-X", "POST", f"{root}/logout")[0] == 303
        assert curl(*ask, f"{root}/")[0] == 303
    finally:
        process.send_signal(signal.SIGINT)
        assert process.wait(30) == 0
