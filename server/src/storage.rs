//! Where files live: one interface over `object_store`, a folder today. Files are named by the SHA-256 of their bytes, so
//! that the same bytes are kept once and what a name means never changes.

use std::io::Read;
use std::ops::Range;
use std::path::Path as FilePath;
use std::sync::Arc;

use bytes::Bytes;
use futures_util::stream::BoxStream;
use object_store::local::LocalFileSystem;
use object_store::path::Path;
use object_store::{Error, GetOptions, GetRange, ObjectStore, ObjectStoreExt, Result, WriteMultipart};
use sha2::{Digest, Sha256};

use crate::model::hex;

/// Bytes given to the store at a time.
const PART: usize = 5 << 20;
/// Parts under way at once.
const PARTS_AT_ONCE: usize = 2;

/// The name of stored bytes: their SHA-256.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct Key(String);

impl Key {
    /// The key of some bytes.
    pub fn of(bytes: &[u8]) -> Self {
        Self::from_digest(&Sha256::digest(bytes))
    }

    pub fn from_digest(digest: &[u8]) -> Self {
        Self(hex(digest))
    }

    /// The key written as 64 lower-case hexadecimal digits; `None` where it is anything else.
    pub fn parse(text: &str) -> Option<Self> {
        let digits = text.bytes().all(|b| matches!(b, b'0'..=b'9' | b'a'..=b'f'));
        (text.len() == 64 && digits).then(|| Self(text.to_string()))
    }

    pub fn as_str(&self) -> &str {
        &self.0
    }

    fn path(&self) -> Path {
        Path::from_iter(["objects", &self.0[..2], &self.0])
    }
}

/// The store of all files.
#[derive(Debug, Clone)]
pub struct Storage {
    store: Arc<dyn ObjectStore>,
}

impl Storage {
    /// A folder, made where it is absent.
    pub fn folder(folder: &FilePath) -> anyhow::Result<Self> {
        std::fs::create_dir_all(folder)?;
        Ok(Self::over(Arc::new(LocalFileSystem::new_with_prefix(folder)?)))
    }

    /// Any store.
    pub fn over(store: Arc<dyn ObjectStore>) -> Self {
        Self { store }
    }

    /// Keeps bytes; returns their key.
    pub async fn put(&self, bytes: Bytes) -> Result<Key> {
        let key = Key::of(&bytes);
        if !self.holds(&key, bytes.len() as u64).await? {
            self.store.put(&key.path(), bytes.into()).await?;
        }
        Ok(key)
    }

    /// Keeps a file whose key is known, part by part; a failure leaves nothing behind.
    pub async fn put_file(&self, key: &Key, file: &FilePath, bytes: u64) -> Result<()> {
        if self.holds(key, bytes).await? {
            return Ok(());
        }
        let upload = self.store.put_multipart(&key.path()).await?;
        let mut writer = WriteMultipart::new_with_chunk_size(upload, PART);
        let mut source = std::fs::File::open(file).map_err(generic)?;
        let copied = loop {
            if let Err(error) = writer.wait_for_capacity(PARTS_AT_ONCE).await {
                break Err(error);
            }
            let part = tokio::task::spawn_blocking(move || read_part(source).map_err(generic)).await?;
            match part {
                Ok((_, part)) if part.is_empty() => break Ok(()),
                Ok((rest, part)) => {
                    source = rest;
                    writer.put(part);
                }
                Err(error) => break Err(error),
            }
        };
        match copied {
            Ok(()) => writer.finish().await.map(|_| ()),
            Err(error) => {
                // The first error is the one worth telling.
                let _ = writer.abort().await;
                Err(error)
            }
        }
    }

    /// A stretch of stored bytes, as a stream.
    pub async fn read(&self, key: &Key, range: Range<u64>) -> Result<BoxStream<'static, Result<Bytes>>> {
        let options = GetOptions { range: Some(GetRange::Bounded(range)), ..GetOptions::default() };
        Ok(self.store.get_opts(&key.path(), options).await?.into_stream())
    }

    /// All bytes of a key.
    pub async fn read_all(&self, key: &Key) -> Result<Bytes> {
        self.store.get(&key.path()).await?.bytes().await
    }

    /// Forgets a key; one that is not there is no error.
    pub async fn delete(&self, key: &Key) -> Result<()> {
        match self.store.delete(&key.path()).await {
            Err(Error::NotFound { .. }) => Ok(()),
            other => other,
        }
    }

    /// Whether something can be written and read back.
    pub async fn check(&self) -> Result<()> {
        let probe = Path::from("probe");
        self.store.put(&probe, Bytes::from_static(b"probe").into()).await?;
        self.store.get(&probe).await?.bytes().await?;
        Ok(())
    }

    async fn holds(&self, key: &Key, bytes: u64) -> Result<bool> {
        match self.store.head(&key.path()).await {
            Ok(found) => Ok(found.size == bytes),
            Err(Error::NotFound { .. }) => Ok(false),
            Err(error) => Err(error),
        }
    }
}

fn read_part(source: std::fs::File) -> std::io::Result<(std::fs::File, Bytes)> {
    let mut part = Vec::new();
    (&source).take(PART as u64).read_to_end(&mut part)?;
    Ok((source, part.into()))
}

fn generic(error: std::io::Error) -> Error {
    Error::Generic { store: "spool", source: Box::new(error) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_digests_are_keys() {
        assert!(Key::parse(Key::of(b"x").as_str()).is_some());
        for bad in ["", "..", &"A".repeat(64), &"g".repeat(64), &format!("../{}", "a".repeat(61))] {
            assert!(Key::parse(bad).is_none(), "{bad}");
        }
    }

    #[tokio::test]
    async fn bytes_come_back_whole_and_in_part() {
        let folder = tempfile::tempdir().unwrap();
        let storage = Storage::folder(folder.path()).unwrap();
        let key = storage.put(Bytes::from_static(b"hello world")).await.unwrap();
        assert_eq!(storage.read_all(&key).await.unwrap(), "hello world");
        let file = folder.path().join("file");
        std::fs::write(&file, b"other").unwrap();
        let other = Key::of(b"other");
        storage.put_file(&other, &file, 5).await.unwrap();
        assert_eq!(storage.read_all(&other).await.unwrap(), "other");
        storage.delete(&key).await.unwrap();
        storage.delete(&key).await.unwrap();
        assert!(storage.read_all(&key).await.is_err());
        storage.check().await.unwrap();
    }
}
