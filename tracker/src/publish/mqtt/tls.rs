//! TLS towards a broker: the authorities that are trusted, and this machine's certificate.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use rustls::crypto::ring;
use rustls::pki_types::pem::PemObject;
use rustls::pki_types::{CertificateDer, PrivateKeyDer};
use rustls::{ClientConfig, RootCertStore};

use crate::{Error, Result};

/// Files in PEM form for `mqtts://`.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct BrokerTls {
    /// Certificates of the authorities that may have signed the broker's certificate; `None`: those that the operating
    /// system trusts.
    pub authority: Option<PathBuf>,
    /// Certificate of this machine and its private key, for brokers that ask for one.
    pub client: Option<(PathBuf, PathBuf)>,
}

impl BrokerTls {
    /// Configuration of the connection.
    ///
    /// # Errors
    /// One line with the option, the file and the mend.
    pub(super) fn config(&self) -> Result<Arc<ClientConfig>> {
        let roots = match &self.authority {
            Some(file) => authorities(file)?,
            None => system_authorities()?,
        };
        let builder = ClientConfig::builder_with_provider(Arc::new(ring::default_provider()))
            .with_safe_default_protocol_versions()
            .map_err(|e| Error::option("mqtt_ca", e.to_string()))?
            .with_root_certificates(roots);
        let config = match &self.client {
            None => builder.with_no_client_auth(),
            Some((certificate, key)) => {
                let chain = certificates("mqtt_certificate", certificate)?;
                let private = PrivateKeyDer::from_pem_file(key)
                    .map_err(|e| unreadable("mqtt_key", key, &e.to_string()))?;
                builder.with_client_auth_cert(chain, private).map_err(|e| {
                    let problem = format!("{}: {e}; give the key of the certificate", key.display());
                    Error::option("mqtt_key", problem)
                })?
            }
        };
        Ok(Arc::new(config))
    }
}

fn authorities(file: &Path) -> Result<RootCertStore> {
    let mut roots = RootCertStore::empty();
    for certificate in certificates("mqtt_ca", file)? {
        roots.add(certificate).map_err(|e| unreadable("mqtt_ca", file, &e.to_string()))?;
    }
    Ok(roots)
}

fn system_authorities() -> Result<RootCertStore> {
    let mut roots = RootCertStore::empty();
    // A system's store may hold certificates that are no authorities; the others are enough.
    let (added, _) = roots.add_parsable_certificates(rustls_native_certs::load_native_certs().certs);
    if added == 0 {
        let problem = "this system trusts no authority (on Debian: apt-get install ca-certificates); give the file of the \
                       broker's authority";
        return Err(Error::option("mqtt_ca", problem));
    }
    Ok(roots)
}

fn certificates(option: &str, file: &Path) -> Result<Vec<CertificateDer<'static>>> {
    let read =
        CertificateDer::pem_file_iter(file).and_then(Iterator::collect::<std::result::Result<Vec<_>, _>>);
    let found = read.map_err(|e| unreadable(option, file, &e.to_string()))?;
    if found.is_empty() {
        return Err(unreadable(option, file, "there is no certificate in it"));
    }
    Ok(found)
}

fn unreadable(option: &str, file: &Path, problem: &str) -> Error {
    Error::option(option, format!("{}: {problem}; give a file in PEM form", file.display()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use rcgen::{CertifiedKey, generate_simple_self_signed};

    #[test]
    fn unusable_files_are_named_with_their_option() {
        let folder = tempfile::tempdir().unwrap();
        let file = |name: &str, text: &str| {
            let path = folder.path().join(name);
            std::fs::write(&path, text).unwrap();
            path
        };
        let certified = || generate_simple_self_signed(vec!["localhost".to_owned()]).unwrap();
        let CertifiedKey { cert, signing_key } = certified();
        let (certificate, key) = (file("a.pem", &cert.pem()), file("a.key", &signing_key.serialize_pem()));
        let other_key = file("b.key", &certified().signing_key.serialize_pem());
        let text = file("text.pem", "no certificate\n");
        let tls = |authority: &PathBuf, client: Option<(&PathBuf, &PathBuf)>| BrokerTls {
            authority: Some(authority.clone()),
            client: client.map(|(certificate, key)| (certificate.clone(), key.clone())),
        };
        tls(&certificate, None).config().unwrap();
        tls(&certificate, Some((&certificate, &key))).config().unwrap();
        let none = folder.path().join("none.pem");
        for (bad, option) in [
            (tls(&none, None), "mqtt_ca: "),
            (tls(&text, None), "mqtt_ca: "),
            (tls(&certificate, Some((&text, &key))), "mqtt_certificate: "),
            (tls(&certificate, Some((&certificate, &certificate))), "mqtt_key: "),
            (tls(&certificate, Some((&certificate, &other_key))), "mqtt_key: "),
        ] {
            let line = bad.config().unwrap_err().to_string();
            assert!(line.starts_with(option) && line.contains(".pem") | line.contains(".key"), "{line}");
            assert!(!line.contains('\n'), "{line}");
        }
    }
}
