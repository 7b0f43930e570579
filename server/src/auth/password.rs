//! Passwords: argon2id, a few at a time so that logging in cannot eat the machine.

use argon2::password_hash::phc::PasswordHash;
use argon2::password_hash::{PasswordHasher, PasswordVerifier};
use argon2::{Algorithm, Argon2, Params, Version};
use tokio::sync::Semaphore;

use crate::config::PasswordCost;
use crate::error::{Error, Result};

/// Passwords hashed at the same time.
const AT_ONCE: usize = 2;
/// Fewest and most characters.
const LENGTH: std::ops::RangeInclusive<usize> = 10..=200;

/// Hashes and verifies.
#[derive(Debug)]
pub struct Passwords {
    argon: Argon2<'static>,
    permits: Semaphore,
    /// Verified against where there is no such account, so that the answer takes as long.
    nobody: String,
}

impl Passwords {
    pub fn new(cost: PasswordCost) -> anyhow::Result<Self> {
        let params =
            Params::new(cost.memory_kib, cost.passes, 1, None).map_err(|e| anyhow::anyhow!("{e}"))?;
        let argon = Argon2::new(Algorithm::Argon2id, Version::V0x13, params);
        let nobody = hash_with(&argon, "nobody has this password").map_err(|e| anyhow::anyhow!("{e}"))?;
        Ok(Self { argon, permits: Semaphore::new(AT_ONCE), nobody })
    }

    /// The hash to keep; refuses passwords that are too short or absurdly long.
    pub async fn hash(&self, password: String) -> Result<String> {
        if !LENGTH.contains(&password.chars().count()) {
            let detail = format!("A password has {} to {} characters.", LENGTH.start(), LENGTH.end());
            return Err(Error::unprocessable("bad_password", detail));
        }
        let argon = self.argon.clone();
        self.work(move || hash_with(&argon, &password)).await?
    }

    /// Whether the password belongs to the hash; no hash takes as long and is always wrong.
    pub async fn verify(&self, password: String, hash: Option<&str>) -> Result<bool> {
        let known = hash.is_some();
        let hash = hash.unwrap_or(&self.nobody).to_string();
        let matches = self.work(move || verify_with(&password, &hash)).await?;
        Ok(matches && known)
    }

    async fn work<T: Send + 'static>(&self, job: impl FnOnce() -> T + Send + 'static) -> Result<T> {
        let _permit = self.permits.acquire().await.map_err(Error::internal)?;
        tokio::task::spawn_blocking(job).await.map_err(Error::internal)
    }
}

fn hash_with(argon: &Argon2<'_>, password: &str) -> Result<String> {
    let hash = argon.hash_password(password.as_bytes()).map_err(Error::internal)?;
    Ok(hash.to_string())
}

fn verify_with(password: &str, hash: &str) -> bool {
    // The parameters are the hash's own, so that the cost can be raised later.
    PasswordHash::new(hash)
        .is_ok_and(|parsed| Argon2::default().verify_password(password.as_bytes(), &parsed).is_ok())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn only_the_right_password_is_right() {
        let passwords = Passwords::new(PasswordCost { memory_kib: 8, passes: 1 }).unwrap();
        let hash = passwords.hash("correct horse".into()).await.unwrap();
        assert!(hash.starts_with("$argon2id$"));
        assert!(passwords.verify("correct horse".into(), Some(&hash)).await.unwrap());
        assert!(!passwords.verify("wrong horse".into(), Some(&hash)).await.unwrap());
        assert!(!passwords.verify("nobody has this password".into(), None).await.unwrap());
        assert!(passwords.hash("short".into()).await.is_err());
    }
}
