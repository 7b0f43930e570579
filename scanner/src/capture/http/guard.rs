//! Who may give orders: whoever has the token of this start, from the daemon's own page.
//!
//! The token keeps other users and programs of this computer out, the checks of `Origin` and `Host` other pages in the same
//! browser (a page elsewhere can send requests here, and can have its own name point here).

use std::net::{IpAddr, SocketAddr};

use axum::extract::{Request, State};
use axum::http::{HeaderMap, HeaderValue, header};
use axum::middleware::Next;
use axum::response::Response;
use subtle::ConstantTimeEq;

use super::Daemon;
use super::problem::Problem;
use crate::upload::hex;

/// 256 random bits as 64 hexadecimal digits; shown only in the address that is printed.
#[derive(Clone)]
pub struct Token(String);

impl Token {
    /// A new one.
    pub fn random() -> Result<Self, getrandom::Error> {
        let mut bytes = [0u8; 32];
        getrandom::fill(&mut bytes)?;
        Ok(Self(hex(&bytes)))
    }

    /// For the address.
    pub fn text(&self) -> &str {
        &self.0
    }

    /// Takes as long whichever digit differs.
    fn is(&self, other: &str) -> bool {
        self.0.as_bytes().ct_eq(other.as_bytes()).into()
    }
}

impl std::fmt::Debug for Token {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Token(hidden)")
    }
}

/// What requests are checked against.
#[derive(Debug)]
pub struct Gate {
    token: Token,
    address: SocketAddr,
}

impl Gate {
    /// For a daemon that listens at `address`.
    pub fn new(token: Token, address: SocketAddr) -> Self {
        Self { token, address }
    }

    /// The address to open in the browser.
    pub fn url(&self) -> String {
        // Who listens everywhere is reached from here by the loopback.
        let ip = match self.address.ip() {
            ip if !ip.is_unspecified() => ip,
            IpAddr::V4(_) => IpAddr::from([127, 0, 0, 1]),
            IpAddr::V6(_) => IpAddr::from(std::net::Ipv6Addr::LOCALHOST),
        };
        format!("http://{}/#token={}", SocketAddr::new(ip, self.address.port()), self.token.text())
    }

    /// Whether an authority (`host:port`) is this daemon: by a number, never by a name that somebody else can point here.
    fn is_own(&self, authority: &str) -> bool {
        let port = self.address.port();
        if let Some(name) = authority.strip_suffix(&format!(":{port}"))
            && name.eq_ignore_ascii_case("localhost")
        {
            return self.address.ip().is_loopback() || self.address.ip().is_unspecified();
        }
        // Browsers leave out port 80.
        let address: Option<SocketAddr> = authority.parse().ok().or_else(|| {
            let ip = authority.trim_start_matches('[').trim_end_matches(']').parse().ok()?;
            Some(SocketAddr::new(ip, 80))
        });
        address.is_some_and(|found| {
            found.port() == port && (self.address.ip().is_unspecified() || found.ip() == self.address.ip())
        })
    }

    fn is_own_origin(&self, origin: &str) -> bool {
        origin.strip_prefix("http://").is_some_and(|authority| self.is_own(authority))
    }

    /// The policy that every answer carries.
    fn policy(host: &str) -> String {
        format!(
            "default-src 'none'; script-src 'self'; style-src 'self'; font-src 'self'; img-src 'self' blob:; \
             connect-src 'self' ws://{host}; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
        )
    }
}

/// Refuses requests that another page sent, or that reached the daemon by a foreign name.
pub(super) async fn require_own_page(State(daemon): State<Daemon>, request: Request, next: Next) -> Response {
    let (host, foreign_origin) = {
        let text = |name| request.headers().get(name).map(|value| value.to_str().unwrap_or_default());
        let host = text(header::HOST).filter(|host| daemon.gate.is_own(host)).map(str::to_owned);
        (host, text(header::ORIGIN).is_some_and(|origin| !daemon.gate.is_own_origin(origin)))
    };
    let mut response = match &host {
        None => {
            Problem::forbidden("This is not the daemon's address. Open the address that it printed.").into()
        }
        Some(_) if foreign_origin => {
            Problem::forbidden("This request came from another page. Use the daemon's own.").into()
        }
        Some(_) => next.run(request).await,
    };
    let policy = Gate::policy(host.as_deref().unwrap_or("127.0.0.1"));
    add_headers(response.headers_mut(), &policy);
    response
}

fn add_headers(headers: &mut HeaderMap, policy: &str) {
    if let Ok(policy) = HeaderValue::from_str(policy) {
        headers.insert(header::CONTENT_SECURITY_POLICY, policy);
    }
    let fixed = [
        (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
        (header::REFERRER_POLICY, "no-referrer"),
        (header::X_FRAME_OPTIONS, "DENY"),
    ];
    for (name, value) in fixed {
        headers.insert(name, HeaderValue::from_static(value));
    }
    headers.insert("cross-origin-opener-policy", HeaderValue::from_static("same-origin"));
    headers.insert("cross-origin-resource-policy", HeaderValue::from_static("same-origin"));
    headers.entry(header::CACHE_CONTROL).or_insert(HeaderValue::from_static("no-store"));
}

/// Refuses requests without the token: in `Authorization`, or in the address where a browser cannot set headers.
pub(super) async fn require_token(State(daemon): State<Daemon>, request: Request, next: Next) -> Response {
    let bearer = request.headers().get(header::AUTHORIZATION).and_then(|value| value.to_str().ok());
    let bearer = bearer.and_then(|value| value.strip_prefix("Bearer ")).map(str::to_owned);
    // Only what is fetched by an address alone may carry the token there.
    let by_address = request.method().is_safe().then(|| token_of(request.uri().query())).flatten();
    match bearer.or(by_address) {
        Some(token) if daemon.gate.token.is(&token) => next.run(request).await,
        _ => {
            let detail =
                "The token is missing or not of this start. Open the address that scan-product printed.";
            Problem::forbidden(detail).into()
        }
    }
}

fn token_of(query: Option<&str>) -> Option<String> {
    query?.split('&').find_map(|pair| pair.strip_prefix("token=")).map(str::to_owned)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn gate(address: &str) -> Gate {
        Gate::new(Token("ab".repeat(32)), address.parse().unwrap())
    }

    #[test]
    fn only_numbers_and_localhost_are_own_names() {
        let own = gate("127.0.0.1:4000");
        for good in ["127.0.0.1:4000", "localhost:4000", "LOCALHOST:4000"] {
            assert!(own.is_own(good), "{good}");
        }
        for bad in [
            "127.0.0.1",
            "127.0.0.1:4001",
            "evil.example:4000",
            "localhost.evil.example:4000",
            "127.0.0.2:4000",
            "[::1]:4000",
            "",
        ] {
            assert!(!own.is_own(bad), "{bad}");
        }
        let everywhere = gate("0.0.0.0:4000");
        assert!(everywhere.is_own("192.168.1.7:4000") && !everywhere.is_own("scanner.example:4000"));
        assert!(gate("127.0.0.1:80").is_own("127.0.0.1") && gate("[::1]:80").is_own("[::1]"));
        assert!(own.is_own_origin("http://127.0.0.1:4000"));
        for bad in
            ["https://127.0.0.1:4000", "null", "http://evil.example", "http://127.0.0.1:4000.evil.example"]
        {
            assert!(!own.is_own_origin(bad), "{bad}");
        }
        assert!(everywhere.url().starts_with("http://127.0.0.1:4000/#token=abab"));
    }

    #[test]
    fn tokens_are_long_random_and_hidden() {
        let (a, b) = (Token::random().unwrap(), Token::random().unwrap());
        assert!(a.text().len() == 64 && a.text() != b.text());
        assert!(a.is(a.text()) && !a.is(b.text()) && !a.is("") && !a.is(&a.text()[..63]));
        assert!(!format!("{a:?}").contains(a.text()));
    }
}
