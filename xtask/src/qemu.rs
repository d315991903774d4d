//! One run of a program in QEMU: bytes in, bytes and messages out.
//!
//! UART0 of the machine is a TCP connection on the loopback interface, to which QEMU connects, so no address has to be
//! guessed and no file is left behind. Semihosting, which carries defmt, is QEMU's standard output.
//!
//! With `-icount shift=0` every instruction takes 1 ns of virtual time, and a run is the same each time.

use crate::machine::Machine;
use anyhow::{Context, Result, bail};
use defmt_decoder::{DecodeError, Table};
use std::fmt;
use std::io::{ErrorKind, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};
use std::thread;
use std::time::{Duration, Instant};

/// A run that takes longer hangs and is ended.
const TIME_LIMIT: Duration = Duration::from_secs(900);

/// A program for a machine.
#[derive(Debug)]
pub struct Image {
    machine: Machine,
    path: PathBuf,
    elf: Vec<u8>,
}

impl Image {
    /// Reads a program.
    pub fn load(machine: Machine, path: PathBuf) -> Result<Self> {
        let elf = std::fs::read(&path).with_context(|| format!("{} cannot be read; build it first", path.display()))?;
        Ok(Self { machine, path, elf })
    }

    /// The bytes of the ELF file.
    pub fn elf(&self) -> &[u8] {
        &self.elf
    }
}

/// What came of a run.
#[derive(Debug)]
pub struct Run {
    /// Exit code that the program gave by semihosting; `None` if QEMU was ended by a signal, as by a lock-up.
    pub exit_code: Option<i32>,
    /// What the program wrote to UART0.
    pub uart: Vec<u8>,
    /// Its defmt messages, as `LEVEL text`.
    pub messages: Vec<String>,
    /// What QEMU itself had to say.
    pub complaints: String,
}

impl Run {
    /// Whether the program ended by itself with exit code 0.
    pub fn success(&self) -> bool {
        self.exit_code == Some(0)
    }
}

impl fmt::Display for Run {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.exit_code {
            Some(code) => writeln!(f, "exit code {code}")?,
            None => writeln!(f, "QEMU was ended by a signal")?,
        }
        writeln!(f, "{} bytes on the UART; messages:", self.uart.len())?;
        self.messages.iter().try_for_each(|message| writeln!(f, "  {message}"))?;
        write!(f, "{}", self.complaints)
    }
}

/// Runs a program with `input` on its UART0 until it exits.
pub fn run(image: &Image, input: &[u8]) -> Result<Run> {
    let listener = TcpListener::bind(("127.0.0.1", 0)).context("no loopback port for the UART")?;
    let mut qemu = spawn(image, listener.local_addr()?.port())?;
    let (stdout, stderr) = (qemu.stdout.take(), qemu.stderr.take());
    let mut connection = None;
    thread::scope(|scope| {
        let semihosting = scope.spawn(move || read_all(stdout));
        let complaints = scope.spawn(move || read_all(stderr));
        let ran = match accept(&listener, &mut qemu) {
            Ok(uart) => {
                let uart = &*connection.insert(uart);
                scope.spawn(move || send(uart, input));
                let received = scope.spawn(move || read_all(Some(uart)));
                wait(&mut qemu).map(|exit_code| (exit_code, received.join().unwrap_or_default()))
            }
            Err(error) => Err(error),
        };
        let _ = qemu.kill(); // it has ended, unless waiting failed
        let complaints = String::from_utf8_lossy(&complaints.join().unwrap_or_default()).into_owned();
        let (exit_code, uart) = ran.with_context(|| complaints.clone())?;
        let messages = decode(&image.elf, &semihosting.join().unwrap_or_default())?;
        Ok(Run { exit_code, uart, messages, complaints })
    })
}

fn spawn(image: &Image, port: u16) -> Result<Child> {
    Command::new("qemu-system-arm")
        .args(["-machine", image.machine.qemu_name(), "-display", "none", "-monitor", "none"])
        .args(["-icount", "shift=0"])
        .args(["-chardev", &format!("socket,id=uart0,host=127.0.0.1,port={port}"), "-serial", "chardev:uart0"])
        .args(["-chardev", "stdio,id=semihosting,signal=off"])
        .args(["-semihosting-config", "enable=on,target=native,chardev=semihosting"])
        .arg("-kernel")
        .arg(&image.path)
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .context("qemu-system-arm cannot be started; `cargo xtask setup` installs it")
}

/// The connection that QEMU opens when it starts.
fn accept(listener: &TcpListener, qemu: &mut Child) -> Result<TcpStream> {
    listener.set_nonblocking(true)?;
    loop {
        match listener.accept() {
            Ok((uart, _)) => {
                uart.set_nonblocking(false)?;
                return Ok(uart);
            }
            Err(error) if error.kind() == ErrorKind::WouldBlock => {}
            Err(error) => return Err(error).context("QEMU cannot connect its UART"),
        }
        if qemu.try_wait()?.is_some() {
            bail!("QEMU ended before it connected its UART");
        }
        thread::sleep(Duration::from_millis(2));
    }
}

/// Waits for QEMU to end and returns its exit code.
fn wait(qemu: &mut Child) -> Result<Option<i32>> {
    let started = Instant::now();
    loop {
        if let Some(status) = qemu.try_wait()? {
            return Ok(status.code());
        }
        if started.elapsed() > TIME_LIMIT {
            qemu.kill()?;
            bail!("the program did not end within {} s", TIME_LIMIT.as_secs());
        }
        thread::sleep(Duration::from_millis(5));
    }
}

/// Sends all input, and leaves the connection open: QEMU would take its end for that of both directions. A program may
/// end before it has read all of it; that shows in what it answers.
fn send(mut uart: &TcpStream, input: &[u8]) {
    let _ = uart.write_all(input);
}

/// All bytes until the end, or until the connection breaks.
fn read_all(stream: Option<impl Read>) -> Vec<u8> {
    let mut bytes = Vec::new();
    if let Some(mut stream) = stream {
        let _ = stream.read_to_end(&mut bytes);
    }
    bytes
}

/// The defmt messages in a byte stream, by the tables in the ELF file.
fn decode(elf: &[u8], bytes: &[u8]) -> Result<Vec<String>> {
    let Some(table) = Table::parse(elf)? else { return Ok(Vec::new()) };
    let mut decoder = table.new_stream_decoder();
    decoder.received(bytes);
    let mut messages = Vec::new();
    loop {
        match decoder.decode() {
            Ok(frame) => {
                let level = frame.level().map_or("PRINT", |level| level.as_str());
                messages.push(format!("{} {}", level.to_uppercase(), frame.display_message()));
            }
            Err(DecodeError::UnexpectedEof) => return Ok(messages),
            Err(DecodeError::Malformed) => messages.push("(malformed defmt frame)".to_owned()),
        }
    }
}
