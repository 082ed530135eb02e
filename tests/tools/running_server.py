"""A running `qmpipe serve`, for the tests that talk to it."""

import http.client
import json
import os
import signal
import socket
import subprocess


class Server:
    """Ended by its process id."""

    def __init__(self, program, *arguments, pages=None):
        environment = {**os.environ, "QMPIPE_VIEWER": str(pages)} if pages else None
        self.process = subprocess.Popen([program, "serve", *map(str, arguments), "--port", "0", "--json"],
                                        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
                                        env=environment)
        line = self.process.stdout.readline()
        if not line:
            raise RuntimeError(self.process.stderr.read())
        self.said = json.loads(line)
        self.port = self.said["port"]

    def end(self, how=signal.SIGINT):
        """The exit code, and what stands on stderr."""
        self.process.send_signal(how)
        _, errors = self.process.communicate(timeout=60)
        return self.process.returncode, errors

    def connect(self):
        return socket.create_connection(("127.0.0.1", self.port), timeout=30)

    def get(self, path, method="GET", **headers):
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=30)
        connection.request(method, path, headers={k.replace("_", "-"): v for k, v in headers.items()})
        answer = connection.getresponse()
        answer.body = answer.read()
        connection.close()
        return answer

    def send(self, raw, hang_up=False):
        """The first answer to these bytes; empty when the server closes the connection without one.

        With hang_up nothing more is to come from here, and the server may be gone without a word.
        """
        with self.connect() as line:
            said = b""
            try:
                line.sendall(raw)
                if hang_up:
                    line.shutdown(socket.SHUT_WR)
                while not is_whole(said) and (chunk := line.recv(65536)):
                    said += chunk
            except (ConnectionError, BrokenPipeError):
                pass
            return said


def is_whole(said):
    head, end, body = said.partition(b"\r\n\r\n")
    for line in head.split(b"\r\n"):
        name, _, value = line.partition(b":")
        if name.lower() == b"content-length":
            return bool(end) and len(body) >= int(value)
    return False


def status_of(said):
    return int(said.split(b" ", 2)[1]) if said.startswith(b"HTTP/1.") else None
