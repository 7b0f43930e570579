//! Why an order is not carried out: one sentence that says what to do.

use kinect::source::SourceError;

use super::journal::JournalError;
use super::model::RemoveError;

/// A refused order.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum Refusal {
    /// Not possible in this step.
    #[error("{0}")]
    NotNow(String),
    /// The order itself makes no sense.
    #[error("{0}")]
    Wrong(String),
    /// There is no such thing.
    #[error("{0}")]
    Absent(String),
    /// It went wrong.
    #[error("{0}")]
    Failed(String),
}

impl Refusal {
    pub fn not_now(text: impl Into<String>) -> Self {
        Self::NotNow(sentence(&text.into()))
    }

    pub fn wrong(text: impl Into<String>) -> Self {
        Self::Wrong(sentence(&text.into()))
    }

    pub fn absent(text: impl Into<String>) -> Self {
        Self::Absent(sentence(&text.into()))
    }

    pub fn failed(error: &dyn std::fmt::Display) -> Self {
        Self::Failed(sentence(&error.to_string()))
    }
}

/// Begins large and ends with a full stop, as the page shows it.
pub fn sentence(text: &str) -> String {
    let mut letters = text.trim().chars();
    let first: String = letters.next().map(|c| c.to_uppercase().collect()).unwrap_or_default();
    let mut sentence = first + letters.as_str();
    // Paths keep their beginning.
    if text.starts_with('/') {
        text.clone_into(&mut sentence);
    }
    if !sentence.ends_with(['.', '!', '?']) {
        sentence.push('.');
    }
    sentence
}

impl From<JournalError> for Refusal {
    fn from(error: JournalError) -> Self {
        match error {
            JournalError::NoSuchView(_) => Self::absent(error.to_string()),
            JournalError::DiskFull { .. } | JournalError::InUse(_) => Self::not_now(error.to_string()),
            other => Self::failed(&other),
        }
    }
}

impl From<SourceError> for Refusal {
    fn from(error: SourceError) -> Self {
        match error {
            SourceError::NotFound(_) => Self::absent(error.to_string()),
            SourceError::Unable(_) => Self::wrong(error.to_string()),
            other => Self::not_now(other.to_string()),
        }
    }
}

impl From<RemoveError> for Refusal {
    fn from(error: RemoveError) -> Self {
        match error {
            RemoveError::Outdated => Self::not_now(error.to_string()),
            other => Self::wrong(other.to_string()),
        }
    }
}
