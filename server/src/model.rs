//! The words of the trade: roles, states, kinds; ids and times as the outside sees them.

use serde::{Deserialize, Serialize};
use time::OffsetDateTime;
use time::format_description::well_known::Rfc3339;
use utoipa::ToSchema;

/// An enum whose values are words in the database and in JSON.
pub trait Word: Copy + Sized + 'static {
    const ALL: &'static [Self];
    fn word(self) -> &'static str;
    fn from_word(word: &str) -> Option<Self> {
        Self::ALL.iter().copied().find(|value| value.word() == word)
    }
}

macro_rules! words {
    ($(#[$doc:meta])* $name:ident { $($variant:ident = $word:literal),+ $(,)? }) => {
        $(#[$doc])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
        #[serde(rename_all = "snake_case")]
        pub enum $name { $($variant),+ }

        impl Word for $name {
            const ALL: &'static [Self] = &[$(Self::$variant),+];
            fn word(self) -> &'static str {
                match self { $(Self::$variant => $word),+ }
            }
        }
    };
}

words!(
    /// What an account may do.
    Role { Admin = "admin", Seller = "seller" }
);
words!(
    /// What a token may do: `upload` makes listings and sends files, `manage` also edits, activates and deletes.
    Scope { Upload = "upload", Manage = "manage" }
);
words!(
    /// Where a listing stands; only active ones are public.
    Status { Draft = "draft", Active = "active", Archived = "archived" }
);
words!(
    /// What kind of thing it is.
    Category {
        Home = "home",
        Electronics = "electronics",
        Clothing = "clothing",
        Toys = "toys",
        Sport = "sport",
        Books = "books",
        Garden = "garden",
        Other = "other",
    }
);
words!(
    /// How worn it is.
    Condition { New = "new", LikeNew = "like_new", Good = "good", Fair = "fair", Poor = "poor" }
);
words!(
    /// How good the scan is, by the scanner's own report.
    Verdict { Good = "good", Acceptable = "acceptable", Poor = "poor" }
);
words!(
    /// Points, or a surface of triangles.
    ModelKind { Points = "points", Mesh = "mesh" }
);
words!(
    /// What can be uploaded.
    UploadKind { Model = "model", Poster = "poster", Report = "report" }
);
words!(
    /// How far a resumable upload is.
    UploadState { Receiving = "receiving", Done = "done", Failed = "failed" }
);
words!(
    /// What a stored file is to its product.
    FileRole { Model = "model", Stream = "stream", Poster = "poster", Thumb = "thumb", Report = "report" }
);

/// What was found in a model, as it is stored.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ModelInfo {
    pub kind: ModelKind,
    pub points: u64,
    pub triangles: u64,
    pub min: [f32; 3],
    pub max: [f32; 3],
}

/// What the scanner's report says, as it is stored.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ScanInfo {
    pub dimensions_m: Option<[f64; 3]>,
    pub dimensions_uncertainty_m: Option<[f64; 3]>,
    pub verdict: Option<Verdict>,
    pub views_used: u64,
    pub views_total: u64,
    pub warnings: Vec<String>,
    pub software: Option<String>,
}

/// A new id: UUIDv7, so that ids sort by the time they were made.
pub fn new_id() -> String {
    uuid::Uuid::now_v7().to_string()
}

/// An id as somebody sent it, in its one spelling; `None` where it is no id.
pub fn parse_id(text: &str) -> Option<String> {
    uuid::Uuid::try_parse(text).ok().map(|id| id.to_string())
}

/// Microseconds since 1970 as RFC 3339 text in UTC.
pub fn rfc3339(micros: i64) -> String {
    let time = OffsetDateTime::from_unix_timestamp_nanos(i128::from(micros) * 1000);
    time.ok().and_then(|t| t.format(&Rfc3339).ok()).unwrap_or_default()
}

/// Bytes as lower-case hexadecimal text.
pub fn hex(bytes: &[u8]) -> String {
    use std::fmt::Write;
    bytes.iter().fold(String::with_capacity(bytes.len() * 2), |mut text, byte| {
        let _ = write!(text, "{byte:02x}");
        text
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check_words<T: Word + Serialize>() {
        for value in T::ALL {
            assert_eq!(serde_json::to_value(value).unwrap(), value.word());
            assert!(T::from_word(value.word()).is_some());
        }
    }

    #[test]
    fn json_and_database_use_the_same_words() {
        check_words::<Role>();
        check_words::<Scope>();
        check_words::<Status>();
        check_words::<Category>();
        check_words::<Condition>();
        check_words::<Verdict>();
        check_words::<ModelKind>();
        check_words::<UploadKind>();
        check_words::<UploadState>();
        check_words::<FileRole>();
    }

    #[test]
    fn times_are_utc_text() {
        assert_eq!(rfc3339(1_700_000_000_000_000), "2023-11-14T22:13:20Z");
        assert_eq!(parse_id("../../etc"), None);
    }
}
