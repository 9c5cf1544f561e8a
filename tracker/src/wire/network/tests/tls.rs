//! Tests of encrypted links: a peer with a certificate of the right authority, and the right name, is accepted.

use std::path::{Path, PathBuf};

use rcgen::{BasicConstraints, CertificateParams, DnType, IsCa, Issuer, KeyPair};

use super::*;
use crate::wire::Tls;

/// Authority, and the folder that holds its files.
struct Authority {
    issuer: Issuer<'static, KeyPair>,
    file: PathBuf,
    folder: PathBuf,
}

impl Authority {
    fn new(folder: &Path, name: &str) -> Self {
        let mut params = CertificateParams::new(Vec::new()).unwrap();
        params.is_ca = IsCa::Ca(BasicConstraints::Unconstrained);
        params.distinguished_name.push(DnType::CommonName, name);
        let key = KeyPair::generate().unwrap();
        let file = folder.join(format!("{name}.pem"));
        std::fs::write(&file, params.self_signed(&key).unwrap().pem()).unwrap();
        Self { issuer: Issuer::new(params, key), file, folder: folder.to_owned() }
    }

    /// Files of a peer of this name, which accepts certificates that `trusted` has signed.
    fn sign(&self, name: &str, trusted: &Self) -> Tls {
        let mut params = CertificateParams::new(vec!["localhost".to_owned()]).unwrap();
        params.distinguished_name.push(DnType::CommonName, name);
        let key = KeyPair::generate().unwrap();
        let path = |what: &str| self.folder.join(format!("{name}.{what}.pem"));
        std::fs::write(path("certificate"), params.signed_by(&key, &self.issuer).unwrap().pem()).unwrap();
        std::fs::write(path("key"), key.serialize_pem()).unwrap();
        Tls { certificate: path("certificate"), key: path("key"), authority: trusted.file.clone() }
    }
}

fn encrypted(address: &str, tls: &Tls) -> (Endpoints, Endpoints) {
    let address: String = format!("tls/localhost:{}", address.rsplit(':').next().unwrap());
    let with = |endpoints: Endpoints| Endpoints { tls: Some(tls.clone()), ..endpoints };
    (with(listening(&address)), with(connecting(&address)))
}

#[test]
fn only_peers_with_accepted_certificates_are_admitted() {
    let folder = tempfile::tempdir().unwrap();
    let (own, foreign) = (Authority::new(folder.path(), "own"), Authority::new(folder.path(), "foreign"));
    let address = free_address();
    let (listen, _) = encrypted(&address, &own.sign("gatherer", &own));
    let listen = Endpoints { allow: vec!["camera 0".into(), "camera 1".into()], ..listen };
    let gatherer = gather(&["cam0"], listen, BOUND);
    let wait = |tls: Tls| {
        let (_, connect) = encrypted(&address, &tls);
        let (uplink, feedback) = Uplink::open(hello("cam0", false), &connect).unwrap();
        uplink.wait_for_start(Some(Duration::from_secs(2)), &GO_ON).map(|()| (uplink, feedback))
    };
    for (name, tls) in [
        ("signed by another authority", foreign.sign("camera 0", &own)),
        ("with a name that is not allowed", own.sign("camera 7", &own)),
    ] {
        let line = wait(tls).expect_err(name).to_string();
        assert!(line.starts_with("station `cam0`: no gatherer within 2 s"), "{name}: {line}");
    }
    let (mut uplink, feedback) = wait(own.sign("camera 1", &own)).unwrap();
    let mut gatherer = gatherer.join().unwrap().unwrap();
    uplink.send(event("cam0", 1)).unwrap();
    assert_eq!(gatherer.next_seen(0).observation, seen("cam0", 1).observation);
    (gatherer.ports[0].feedback)(super::feedback(1));
    assert_eq!(feedback.recv_timeout(BOUND).unwrap(), super::feedback(1));
    uplink.send(Event::Ended).unwrap();
}

#[test]
fn files_that_are_no_certificates_are_told_in_one_line() {
    let folder = tempfile::tempdir().unwrap();
    let authority = Authority::new(folder.path(), "own");
    let tls = authority.sign("camera 0", &authority);
    let broken = folder.path().join("broken.pem");
    std::fs::write(&broken, "-----BEGIN CERTIFICATE-----\n!!!\n-----END CERTIFICATE-----\n").unwrap();
    let (listen, _) = encrypted(&free_address(), &Tls { certificate: broken, ..tls });
    let line = gather(&["cam0"], listen, BOUND).join().unwrap().err().unwrap().to_string();
    println!("{line}");
    assert!(line.starts_with("stations: the network cannot be joined: ") && !line.contains('\n'), "{line}");
}
