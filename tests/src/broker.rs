//! A real MQTT broker (Debian's `mosquitto`) and a subscriber that is independent of the project's client.

use std::fmt::Write as _;
use std::io::{BufRead, BufReader};
use std::net::{SocketAddr, TcpStream};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use crate::chain::StepResult;
use crate::live::run::{Scratch, free_address};

/// Longest wait for the broker to listen, and for the subscriber to subscribe.
const BOUND: Duration = Duration::from_secs(20);
/// Interval of looks.
const POLL: Duration = Duration::from_millis(20);

/// Files of a broker with TLS; it asks for certificates of the same authority.
#[derive(Debug, Clone)]
pub struct BrokerCertificates {
    /// Certificate of the authority.
    pub authority: PathBuf,
    /// Certificate of the broker.
    pub certificate: PathBuf,
    /// Its private key.
    pub key: PathBuf,
}

/// Options of a broker.
#[derive(Debug, Clone, Default)]
pub struct BrokerOptions {
    /// The only user, with the password; without it everyone may connect.
    pub user: Option<(String, String)>,
    /// Certificates for TLS.
    pub tls: Option<BrokerCertificates>,
}

/// A broker on the loopback. Subscriptions and undelivered messages survive its death.
#[derive(Debug)]
pub struct Broker {
    child: Option<Child>,
    address: SocketAddr,
    scratch: Scratch,
}

/// A message as the subscriber received it.
#[derive(Debug, Clone, PartialEq)]
pub struct Received {
    /// Time of day of its arrival, seconds since 1970.
    pub at_s: f64,
    /// Whether it is an older message that the broker had kept.
    pub is_retained: bool,
    /// Topic.
    pub topic: String,
    /// Content.
    pub payload: String,
}

/// Finds a program of Debian's packages mosquitto and mosquitto-clients.
fn installed(name: &str) -> StepResult<PathBuf> {
    let folders = ["/usr/sbin", "/usr/bin", "/usr/local/sbin", "/usr/local/bin"];
    let found = folders.iter().map(|folder| Path::new(folder).join(name)).find(|path| path.is_file());
    found.ok_or_else(|| format!("`{name}` is not installed; run `make setup` first"))
}

impl Broker {
    /// Starts a broker at a free port.
    ///
    /// # Errors
    /// The program is not installed, or does not listen.
    pub fn start(options: &BrokerOptions) -> StepResult<Self> {
        let (address, scratch) = (free_address()?, Scratch::new()?);
        let mut config = format!("listener {} 127.0.0.1\n", address.port());
        // As root the broker would become another user, who cannot read the folder. The data base is written after each
        // change, so that a broker that is killed forgets nothing.
        let _ = write!(
            config,
            "user root\npersistence true\npersistence_location {}/\nautosave_on_changes true\nautosave_interval 1\n\
             max_queued_messages 0\n",
            scratch.path("").display()
        );
        match &options.user {
            None => config += "allow_anonymous true\n",
            Some((user, password)) => {
                let file = scratch.path("passwords");
                let made = Command::new(installed("mosquitto_passwd")?)
                    .args(["-b", "-c"])
                    .arg(&file)
                    .args([user, password])
                    .output();
                made.map_err(|e| format!("mosquitto_passwd: {e}"))?;
                let _ = writeln!(config, "allow_anonymous false\npassword_file {}", file.display());
            }
        }
        if let Some(BrokerCertificates { authority, certificate, key }) = &options.tls {
            let _ = writeln!(
                config,
                "cafile {}\ncertfile {}\nkeyfile {}\nrequire_certificate true",
                authority.display(),
                certificate.display(),
                key.display()
            );
        }
        std::fs::write(scratch.path("mosquitto.conf"), config).map_err(|e| e.to_string())?;
        let mut broker = Self { child: None, address, scratch };
        broker.restart()?;
        Ok(broker)
    }

    /// Address of the broker.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// Kills the broker as a crash does.
    pub fn kill(&mut self) {
        if let Some(mut child) = self.child.take() {
            // An error means that it has ended already.
            let _ = child.kill();
            let _ = child.wait();
        }
    }

    /// Starts a killed broker again, at the same address and with the same sessions.
    ///
    /// # Errors
    /// It does not listen.
    pub fn restart(&mut self) -> StepResult<()> {
        let config = self.scratch.path("mosquitto.conf");
        let mut command = Command::new(installed("mosquitto")?);
        command.arg("-c").arg(&config).stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
        self.child = Some(command.spawn().map_err(|e| format!("mosquitto: {e}"))?);
        let until = Instant::now() + BOUND;
        while TcpStream::connect(self.address).is_err() {
            if Instant::now() > until {
                return Err("mosquitto does not listen".to_owned());
            }
            thread::sleep(POLL);
        }
        Ok(())
    }
}

impl Drop for Broker {
    fn drop(&mut self) {
        self.kill();
    }
}

/// Number of subscribers of this process: each has a session of its own.
static SUBSCRIBERS: AtomicUsize = AtomicUsize::new(0);

/// Subscriber of all topics, `mosquitto_sub`, with a session that survives the broker's death.
#[derive(Debug)]
pub struct Subscriber {
    child: Child,
    received: Arc<Mutex<Vec<Received>>>,
    reader: Option<JoinHandle<()>>,
}

impl Subscriber {
    /// Subscribes to everything at a broker without users and TLS. Returns when a message of its own has come back, so
    /// that none is missed later.
    ///
    /// # Errors
    /// The program is not installed, or nothing comes back.
    pub fn start(broker: &Broker) -> StepResult<Self> {
        let port = broker.address.port().to_string();
        let name = format!("subscriber{}", SUBSCRIBERS.fetch_add(1, Ordering::Relaxed));
        let mut command = Command::new("stdbuf");
        command.arg("-oL").arg(installed("mosquitto_sub")?);
        command.args(["-h", "127.0.0.1", "-p", &port, "-t", "#", "-q", "1", "-c", "-i", &name]);
        command.args(["-F", "%U\\t%r\\t%t\\t%p"]);
        let spawned = command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::null()).spawn();
        let mut child = spawned.map_err(|e| format!("mosquitto_sub: {e}"))?;
        let received = Arc::<Mutex<Vec<Received>>>::default();
        let own = Arc::clone(&received);
        let reader = child.stdout.take().map(|lines| {
            thread::spawn(move || {
                for line in BufReader::new(lines).lines().map_while(Result::ok) {
                    own.lock().unwrap_or_else(PoisonError::into_inner).extend(parse(&line));
                }
            })
        });
        let subscriber = Self { child, received, reader };
        let publish = installed("mosquitto_pub")?;
        let until = Instant::now() + BOUND;
        while subscriber.topic("hello").is_empty() {
            if Instant::now() > until {
                return Err("mosquitto_sub does not subscribe".to_owned());
            }
            let arguments = ["-h", "127.0.0.1", "-p", &port, "-t", "hello", "-m", "x"];
            Command::new(&publish).args(arguments).output().map_err(|e| format!("mosquitto_pub: {e}"))?;
            thread::sleep(5 * POLL);
        }
        Ok(subscriber)
    }

    /// Messages so far.
    pub fn received(&self) -> Vec<Received> {
        self.received.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// Contents of the messages of a topic so far, in order.
    pub fn topic(&self, topic: &str) -> Vec<String> {
        let found = self.received().into_iter().filter(|message| message.topic == topic);
        found.map(|message| message.payload).collect()
    }

    /// Waits until `is_true` holds for the messages.
    ///
    /// # Errors
    /// It does not hold in time.
    pub fn wait_for(&self, within: Duration, is_true: impl Fn(&[Received]) -> bool) -> StepResult<()> {
        let until = Instant::now() + within;
        while !is_true(&self.received()) {
            if Instant::now() > until {
                return Err(format!("the messages have not come: {:?}", self.received().last()));
            }
            thread::sleep(POLL);
        }
        Ok(())
    }
}

impl Drop for Subscriber {
    fn drop(&mut self) {
        // An error means that the process has ended.
        let _ = self.child.kill();
        let _ = self.child.wait();
        if let Some(reader) = self.reader.take() {
            // A thread that panicked has printed why.
            let _ = reader.join();
        }
    }
}

fn parse(line: &str) -> Option<Received> {
    let mut parts = line.splitn(4, '\t');
    let (at, retained, topic) = (parts.next()?, parts.next()?, parts.next()?);
    Some(Received {
        at_s: at.parse().ok()?,
        is_retained: retained == "1",
        topic: topic.to_owned(),
        payload: parts.next()?.to_owned(),
    })
}
