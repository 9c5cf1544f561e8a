//! The editor's page while clients misbehave: it is neither ended nor silenced.

use std::io::{BufRead, BufReader, Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use tests::data::{office, program};

/// The editor of the office, in a process that may open few files.
struct Editor {
    process: Child,
    address: SocketAddr,
}

impl Editor {
    fn start(files: u32) -> Self {
        let program = program("scenes");
        let mut process = Command::new("sh")
            .args(["-c", &format!("ulimit -n {files}; exec \"$0\" edit \"$1\" --port 0")])
            .args([program.get_program(), office().join("room").as_os_str()])
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .expect("the editor starts");
        let mut line = String::new();
        BufReader::new(process.stdout.take().expect("its output")).read_line(&mut line).expect("a line");
        let address =
            line.split("http://").nth(1).and_then(|rest| rest.split('/').next()).expect("its address");
        Self { process, address: address.parse().expect("an address") }
    }

    /// Head of the answer to a request.
    fn ask(&self, host: &str, more: &str) -> String {
        let mut stream = TcpStream::connect(self.address).expect("a connection");
        stream.set_read_timeout(Some(Duration::from_mins(1))).expect("a timeout");
        let request = format!("GET /room.json HTTP/1.1\r\nHost: {host}\r\n{more}Connection: close\r\n\r\n");
        stream.write_all(request.as_bytes()).expect("a request");
        let mut answer = Vec::new();
        stream.read_to_end(&mut answer).expect("an answer");
        String::from_utf8_lossy(&answer).lines().next().unwrap_or_default().to_owned()
    }
}

impl Drop for Editor {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

#[test]
fn idle_sockets_neither_end_nor_silence_the_editor() {
    let mut editor = Editor::start(64);
    assert!(editor.ask("localhost", "").contains("200"));
    let mut idle = Vec::new();
    for i in 0..300 {
        let Ok(mut stream) = TcpStream::connect_timeout(&editor.address, Duration::from_secs(10)) else {
            break;
        };
        // Some begin to speak.
        let _ = stream.write_all(&b"GET / HTTP/1.1\r\nHost: localhost\r\n"[..i % 30]);
        idle.push(stream);
    }
    assert!(idle.len() > 100, "{} connections", idle.len());
    let begun = Instant::now();
    for _ in 0..5 {
        assert!(editor.ask("localhost", "").contains("200"));
    }
    assert!(begun.elapsed() < Duration::from_secs(20), "{:?}", begun.elapsed());
    assert!(editor.process.try_wait().expect("its state").is_none(), "the editor has ended");
}

#[test]
fn requests_of_other_pages_are_refused() {
    let editor = Editor::start(256);
    for (host, more, status) in [
        ("localhost", "", "200"),
        ("[::1]:8080", "", "200"),
        ("localhost:1", "Origin: http://localhost:1\r\n", "200"),
        ("[::1]evil", "", "403"),
        ("127.0.0.1:1@evil", "", "403"),
        ("localhost", "Host: localhost\r\n", "403"),
        ("localhost:1", "Origin: http://localhost:2\r\n", "403"),
        ("localhost", "Origin: http://evil.example\r\n", "403"),
        ("localhost", "Origin: null\r\n", "403"),
        ("localhost", "Sec-Fetch-Site: cross-site\r\nSec-Fetch-Mode: no-cors\r\n", "403"),
    ] {
        let line = editor.ask(host, more);
        // Two hosts may be refused by the parser of the protocol itself.
        assert!(line.contains(status) || (status == "403" && line.contains("400")), "{host} {more}: {line}");
    }
}
