//! Cross-site requests: what a cookie authenticates must come from our own pages.

use axum::http::{HeaderMap, Method, header};

use crate::config::Config;
use crate::error::{Error, Result};

/// Refuses an unsafe request that a browser sent from another site, or that does not say where it comes from.
pub fn require_same(method: &Method, headers: &HeaderMap, config: &Config) -> Result<()> {
    if method.is_safe() || from_same_site(headers, config) == Some(true) { Ok(()) } else { Err(cross_site()) }
}

/// Refuses an unsafe request that a browser says comes from another site: for requests without a cookie, like logging in.
pub fn refuse_foreign(headers: &HeaderMap, config: &Config) -> Result<()> {
    if from_same_site(headers, config) == Some(false) { Err(cross_site()) } else { Ok(()) }
}

fn cross_site() -> Error {
    let detail = "This request came from another site, or hides where it came from. Use the pages of this server, \
                  or a token.";
    Error::forbidden("cross_site", detail)
}

/// `None`: the request does not say. `Sec-Fetch-Site` decides where it is there: no page can forge it.
fn from_same_site(headers: &HeaderMap, config: &Config) -> Option<bool> {
    if let Some(site) = headers.get("sec-fetch-site") {
        return Some(site == "same-origin" || site == "none");
    }
    let origin = headers.get(header::ORIGIN)?.to_str().ok()?;
    let ours = config.public_url.as_deref().is_some_and(|url| url == origin);
    let host = headers.get(header::HOST).and_then(|host| host.to_str().ok());
    let same_host = origin.split_once("://").is_some_and(|(_, authority)| Some(authority) == host);
    Some(ours || same_host)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(pairs: &[(&'static str, &'static str)], expected: Option<bool>) {
        let mut config = Config::new("data", ([127, 0, 0, 1], 0).into());
        config.public_url = Some("https://shop.example".into());
        let mut headers = HeaderMap::new();
        for (name, value) in pairs {
            headers.insert(*name, value.parse().unwrap());
        }
        assert_eq!(from_same_site(&headers, &config), expected, "{pairs:?}");
    }

    #[test]
    fn where_requests_come_from() {
        check(&[], None);
        check(&[("sec-fetch-site", "same-origin")], Some(true));
        check(&[("sec-fetch-site", "same-site")], Some(false));
        check(&[("sec-fetch-site", "cross-site"), ("origin", "https://shop.example")], Some(false));
        check(&[("origin", "https://shop.example"), ("host", "inner:1")], Some(true));
        check(&[("origin", "http://localhost:8080"), ("host", "localhost:8080")], Some(true));
        check(&[("origin", "https://evil.example"), ("host", "shop.example")], Some(false));
        check(&[("origin", "null"), ("host", "shop.example")], Some(false));
    }
}
