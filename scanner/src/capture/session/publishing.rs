//! Sending the model as it is now to a product server. The token is used and forgotten: it is in no state and in no message.

use std::sync::{Arc, Weak};

use super::{Done, Session};
use crate::capture::model::Edition;
use crate::capture::refusal::{Refusal, sentence};
use crate::capture::state::{PublishPhase, PublishState, Step};
use crate::ui::{Listener, Ui};
use crate::upload::{Destination, Listing, Token, files_to_send, publish};

/// Tells the state how far sending is.
#[derive(Debug)]
struct Progress {
    session: Weak<Session>,
}

impl Listener for Progress {
    fn stage(&self, _name: &str, _total: usize) {}

    fn advanced(&self, bytes: u64) {
        let Some(session) = self.session.upgrade() else { return };
        session.change(|inner| {
            if let Some(publish) = inner.publish.as_mut() {
                publish.sent_bytes = (publish.sent_bytes + bytes).min(publish.total_bytes);
                if publish.sent_bytes == publish.total_bytes {
                    publish.phase = PublishPhase::Processing;
                }
            }
        });
    }

    fn is_wanted(&self) -> bool {
        true
    }
}

impl Session {
    /// Begins to send the model.
    pub fn publish(self: &Arc<Self>, server: &str, token: &str, listing: Listing) -> Done {
        let token = Token::new(token).map_err(|e| Refusal::wrong(e.to_string()))?;
        if listing.title.trim().is_empty() {
            return Err(Refusal::wrong("give the listing a title"));
        }
        self.begin_publishing()?;
        let begun = self.written().and_then(|edition| {
            let files = files_to_send(edition.folder()).map_err(|e| Refusal::failed(&e))?;
            let total_bytes = files.iter().map(|(_, bytes)| bytes).sum();
            self.change(|inner| inner.publish = Some(state(PublishPhase::Uploading, total_bytes)));
            let (session, to) = (Arc::clone(self), Destination::new(server, token));
            let send = move || session.send(&edition, &to, &listing);
            std::thread::Builder::new()
                .name("publish".to_owned())
                .spawn(send)
                .map_err(|e| Refusal::failed(&e))
        });
        begun.map(drop).inspect_err(|refusal| self.failed(&refusal.to_string()))
    }

    fn begin_publishing(&self) -> Done {
        self.change(|inner| {
            inner.check_rests()?;
            if !matches!(inner.step, Step::Result | Step::Published) || inner.model.is_none() {
                return Err(Refusal::not_now("build the model and look at it first"));
            }
            inner.step = Step::Publishing;
            inner.publish = Some(state(PublishPhase::Uploading, 0));
            inner.error = None;
            Ok(())
        })
    }

    fn send(self: &Arc<Self>, edition: &Edition, to: &Destination, listing: &Listing) {
        let ui = Ui::followed_by(Arc::new(Progress { session: Arc::downgrade(self) }));
        match publish(edition.folder(), to, listing, &ui) {
            Ok(published) => self.change(|inner| {
                inner.step = Step::Published;
                if let Some(publish) = inner.publish.as_mut() {
                    publish.phase = PublishPhase::Done;
                    publish.sent_bytes = publish.total_bytes;
                    publish.address = Some(published.url);
                }
            }),
            Err(error) => self.failed(&error.to_string()),
        }
    }

    /// Back to the result, with the reason.
    fn failed(&self, reason: &str) {
        self.change(|inner| {
            inner.step = Step::Result;
            let publish = inner.publish.get_or_insert_with(|| state(PublishPhase::Failed, 0));
            publish.phase = PublishPhase::Failed;
            publish.error = Some(sentence(reason));
        });
    }
}

fn state(phase: PublishPhase, total_bytes: u64) -> PublishState {
    PublishState { phase, sent_bytes: 0, total_bytes, address: None, error: None }
}
