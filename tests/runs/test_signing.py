"""Signatures: whose file it is, and that not a byte of it is another's."""

import json
import logging
from collections.abc import Callable
from pathlib import Path

import fake_optimizer
import pytest
from cryptography.hazmat.primitives import serialization
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey
from cryptography.hazmat.primitives.asymmetric.x25519 import X25519PrivateKey
from typer.testing import CliRunner

from airrace.checkpoint import read_sealed
from airrace.checkpoint.store import BLOCK_SIZE, seal, unseal
from airrace.cli.main import app
from airrace.errors import CheckpointError, UsageError
from airrace.runs import signing
from airrace.runs.run import open_run
from airrace.runs.signing import ensure_signed, signer_of

SECRET, OPEN = serialization.PrivateFormat, serialization.PublicFormat
PLAIN = serialization.NoEncryption()


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with two pairs of keys, and a procedure that computes nothing."""
    monkeypatch.chdir(tmp_path)
    for name, module in fake_optimizer.REPLACED.items():
        monkeypatch.setattr(f"{module}.{name}", getattr(fake_optimizer, name))
    for number, owner in enumerate(("mine", "theirs")):
        key = Ed25519PrivateKey.from_private_bytes(bytes([number]) * 32)
        (tmp_path / owner).write_bytes(key.private_bytes(serialization.Encoding.PEM, SECRET.OpenSSH, PLAIN))
        public = key.public_key().public_bytes(serialization.Encoding.OpenSSH, OPEN.OpenSSH)
        (tmp_path / f"{owner}.pub").write_bytes(public)
    return tmp_path


@pytest.fixture
def signed(folder: Path) -> Path:
    """A run that is signed from its first stage on."""
    assert ran("optimize", "rovinj_2014", "--quiet", "--sign", "mine") == (0, "", "")
    return folder / "rovinj_2014.h5"


def ran(*arguments: str | Path) -> tuple[int, str, str]:
    one = CliRunner().invoke(app, [str(argument) for argument in arguments])
    return one.exit_code, one.stdout, one.stderr


def test_file_is_its_owner_s_to_whoever_has_the_public_key(signed: Path) -> None:
    fingerprint = signer_of(Path("mine")).fingerprint
    assert fingerprint.startswith("SHA256:")
    assert ensure_signed(signed, read_sealed(signed)[1], Path("mine.pub")) == fingerprint
    code, out, _ = ran("verify", signed, "--trust", "mine.pub", "--json")
    assert (code, json.loads(out)["signed_by"], json.loads(out)["unverified"]) == (0, fingerprint, [])
    assert f"signed by {fingerprint}" in ran("show", signed, "--trust", "mine.pub")[1]


def test_signed_file_is_read_like_any_other(signed: Path) -> None:
    assert open_run(signed).race_time == 10.0
    assert ran("show", signed)[0] == 0


def test_keys_in_pem_are_the_same_keys(folder: Path, signed: Path) -> None:
    key = Ed25519PrivateKey.from_private_bytes(bytes(32))
    (folder / "pem").write_bytes(key.private_bytes(serialization.Encoding.PEM, SECRET.PKCS8, PLAIN))
    public = key.public_key().public_bytes(serialization.Encoding.PEM, OPEN.SubjectPublicKeyInfo)
    (folder / "pem.pub").write_bytes(public)
    assert signer_of(folder / "pem").fingerprint == signer_of(folder / "mine").fingerprint
    assert ran("show", signed, "--trust", "pem.pub")[0] == 0


@pytest.mark.parametrize("command", ["verify", "show"])
def test_another_key_and_no_signature_are_refused(command: str, signed: Path, folder: Path) -> None:
    code, _, err = ran(command, signed, "--trust", "theirs.pub")
    assert (code, "is signed with another key, SHA256:" in err) == (7, True)
    open_run(signed).save(folder / "plain.h5")
    assert ran(command, "plain.h5", "--trust", "mine.pub")[::2] == (7, "airrace: plain.h5 is not signed\n")


def test_signature_of_another_file_is_refused(signed: Path, folder: Path) -> None:
    """Put before another image, with the checksum as it should be."""
    other = open_run(signed).signing(signer_of(Path("theirs")))
    other.save(folder / "other.h5")
    image, _ = unseal((folder / "other.h5").read_bytes())
    _, signature = unseal(signed.read_bytes())
    assert signature is not None
    changed = image.replace(b"rovinj_2014", b"rovinj_2015")
    (folder / "other.h5").write_bytes(seal(changed, lambda text: signature))
    code, _, err = ran("verify", "other.h5", "--trust", "mine.pub")
    assert code == 7
    assert err == "airrace: other.h5: the signature does not belong to the content of the file\n"


def test_any_flipped_bit_of_a_signed_file_is_refused(signed: Path) -> None:
    content = signed.read_bytes()
    for position in (*range(BLOCK_SIZE), BLOCK_SIZE + 1000, len(content) - 1):
        flipped = bytearray(content)
        flipped[position] ^= 1 << position % 8
        with pytest.raises(CheckpointError):
            unseal(bytes(flipped))


def test_run_that_is_verified_can_be_signed_later(folder: Path) -> None:
    ran("optimize", "rovinj_2014", "--quiet")
    code, out, _ = ran("verify", "rovinj_2014.h5", "--sign", "mine")
    assert (code, "signed now by SHA256:" in out) == (0, True)
    assert ran("verify", "rovinj_2014.h5", "--trust", "mine.pub")[0] == 0


def test_run_that_is_not_verified_is_not_signed(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    ran("optimize", "rovinj_2014", "--quiet")
    monkeypatch.setenv("FAKE_SCENARIO", "loose")
    assert ran("verify", "rovinj_2014.h5", "--sign", "mine")[0] == 5
    assert read_sealed(folder / "rovinj_2014.h5")[1] is None


def test_nobody_signs_the_stages_of_others(signed: Path) -> None:
    code, _, err = ran("resume", signed, "--sign", "theirs", "--quiet")
    assert code == 7
    assert "is not signed with this key, so it is not signed when it is continued: `airrace verify" in err
    assert ran("resume", signed, "--sign", "mine", "--quiet")[0] == 0
    assert ran("show", signed, "--trust", "mine.pub")[0] == 0


def test_signature_that_gets_lost_is_told(signed: Path, caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.WARNING):
        assert ran("resume", signed, "--quiet")[0] == 0
    assert "was signed; without --sign what it becomes is not" in caplog.text
    assert read_sealed(signed)[1] is None


def locked(folder: Path) -> None:
    secret = serialization.BestAvailableEncryption(b"secret")
    key = Ed25519PrivateKey.from_private_bytes(bytes(32))
    (folder / "key").write_bytes(key.private_bytes(serialization.Encoding.PEM, SECRET.PKCS8, secret))


def of_another_kind(folder: Path) -> None:
    key = X25519PrivateKey.from_private_bytes(bytes(32))
    (folder / "key").write_bytes(key.private_bytes(serialization.Encoding.PEM, SECRET.PKCS8, PLAIN))


@pytest.mark.parametrize(
    ("make", "words"),
    [
        pytest.param(lambda folder: None, "the private key key cannot be read: No such file", id="missing"),
        pytest.param(lambda folder: (folder / "key").mkdir(), "cannot be read: Is a directory", id="folder"),
        pytest.param(lambda folder: (folder / "key").write_text("secret"), "key holds no private key", id="no key"),
        pytest.param(
            lambda folder: (folder / "mine.pub").rename(folder / "key"), "key holds no private key", id="public"
        ),
        pytest.param(locked, "has a passphrase", id="locked"),
        pytest.param(of_another_kind, "of another kind than Ed25519", id="other kind"),
    ],
)
def test_key_that_cannot_be_used_is_one_sentence(make: Callable[[Path], object], words: str, folder: Path) -> None:
    make(folder)
    code, _, err = ran("optimize", "rovinj_2014", "--quiet", "--sign", "key")
    assert (code, err.count("\n")) == (2, 1)
    assert words in err
    assert not (folder / "rovinj_2014.h5").exists()


def test_private_key_is_not_taken_for_a_public_one(signed: Path) -> None:
    with pytest.raises(UsageError, match="mine holds no public key"):
        ensure_signed(signed, read_sealed(signed)[1], Path("mine"))


def test_missing_package_is_named(signed: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def missing(package: str, *_: str) -> None:
        raise UsageError(f"a signature needs {package}: pip install 'airrace[sign]'")

    monkeypatch.setattr(signing, "extra", missing)
    assert ran("show", signed)[0] == 0  # it is asked for where a signature is
    code, _, err = ran("show", signed, "--trust", "mine.pub")
    assert (code, "pip install 'airrace[sign]'" in err) == (2, True)
