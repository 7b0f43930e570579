//! Logging in, sessions, tokens, the first admin.

use std::time::Duration;

use serde_json::json;
use server::model::Scope;

use super::support::{PASSWORD, Server, Who, cookie_of, id_of};

#[test]
fn a_session_from_log_in_to_log_out() {
    let server = Server::start();
    assert!(server.get("/api/session", &Who::Nobody).expect(200).json()["user"].is_null());
    let answer =
        server.post("/api/session", &Who::Nobody, json!({"name": "ANN", "password": PASSWORD})).expect(200);
    let cookie = answer.header("set-cookie");
    assert!(
        cookie.contains("HttpOnly") && cookie.contains("SameSite=Lax") && !cookie.contains("Secure"),
        "{cookie}"
    );
    assert_eq!(answer.json()["user"]["role"], "admin");
    let ann = Who::Cookie(cookie_of(&answer));
    assert_eq!(server.get("/api/session", &ann).expect(200).json()["user"]["name"], "ann");
    server.raw("DELETE", "/api/session", &ann, &[("sec-fetch-site", "same-origin")], vec![]).expect(204);
    assert!(server.get("/api/session", &ann).expect(200).json()["user"].is_null());
    server.get("/api/users", &ann).refused(401, "not_logged_in");
}

#[test]
fn cookies_are_secure_behind_https() {
    let server = Server::start_with(|config| config.public_url = Some("https://shop.example".into()));
    let answer =
        server.post("/api/session", &Who::Nobody, json!({"name": "ann", "password": PASSWORD})).expect(200);
    assert!(answer.header("set-cookie").ends_with("; Secure"));
}

#[test]
fn wrong_passwords_are_counted() {
    let server = Server::start_with(|config| {
        config.limits.login_burst = 3;
        config.times.login_every = Duration::from_hours(1);
    });
    let attempt = || server.post("/api/session", &Who::Nobody, json!({"name": "ann", "password": "wrong"}));
    let nobody = json!({"name": "nobody", "password": "wrong"});
    let wrong = attempt().refused(401, "wrong_password").json();
    let unknown = server.post("/api/session", &Who::Nobody, nobody).refused(401, "wrong_password").json();
    assert_eq!(wrong["detail"], unknown["detail"], "names are not given away");
    attempt().refused(401, "wrong_password");
    let refused = attempt().refused(429, "too_many_attempts");
    assert!(refused.header("retry-after").parse::<u32>().is_ok());
}

#[test]
fn an_expired_session_is_none() {
    let server = Server::start_with(|config| config.times.session_lifetime = Duration::ZERO);
    let ann = server.log_in("ann");
    assert!(server.get("/api/session", &ann).expect(200).json()["user"].is_null());
    server.get("/api/manage/products", &ann).refused(401, "not_logged_in");
    let server = Server::start_with(|config| config.times.session_idle = Duration::ZERO);
    let ann = server.log_in("ann");
    server.get("/api/manage/products", &ann).refused(401, "not_logged_in");
}

#[test]
fn requests_from_other_sites_are_refused() {
    let server = Server::start();
    let ann = server.log_in("ann");
    let make = |headers: &[(&str, &str)]| {
        server.send("POST", "/api/products", &ann, headers, Some(json!({"title": "x"})))
    };
    make(&[("sec-fetch-site", "cross-site"), ("origin", "https://evil.example")]).refused(403, "cross_site");
    make(&[("sec-fetch-site", "same-site")]).refused(403, "cross_site");
    make(&[("origin", "https://evil.example")]).refused(403, "cross_site");
    make(&[("origin", "null")]).refused(403, "cross_site");
    make(&[]).refused(403, "cross_site");
    make(&[("origin", &format!("http://{}", server.address))]).expect(201);
    make(&[("sec-fetch-site", "same-origin")]).expect(201);
    let log_in = json!({"name": "ann", "password": PASSWORD});
    let foreign = [("origin", "https://evil.example")];
    server.send("POST", "/api/session", &Who::Nobody, &foreign, Some(log_in)).refused(403, "cross_site");
}

#[test]
fn tokens_do_what_they_were_made_for_until_revoked() {
    let server = Server::start();
    let sam = server.log_in("sam");
    let body = json!({"name": "my scanner", "scopes": ["upload"], "expires_in_days": 30});
    let made = server.post("/api/tokens", &sam, body).expect(201).json();
    let text = made["token"].as_str().unwrap().to_string();
    assert!(text.starts_with("arp_") && text.starts_with(made["item"]["prefix"].as_str().unwrap()));
    let token = Who::Token(text.clone());
    let id = id_of(&server.draft(&token, "by token"));
    let listed = server.get("/api/tokens", &sam).expect(200);
    assert!(!String::from_utf8_lossy(&listed.body).contains(&text), "shown once");
    assert!(listed.json()["items"][0]["last_used_at"].is_string());
    let edit = |who: &Who| {
        server.send(
            "PATCH",
            &format!("/api/products/{id}"),
            who,
            &[("if-match", "*")],
            Some(json!({"title": "new"})),
        )
    };
    edit(&token).refused(403, "wrong_scope");
    edit(&server.token("sam", &[Scope::Manage])).expect(200);
    server.get("/api/tokens", &token).refused(403, "wrong_scope");
    server.get("/api/users", &server.manager("ann")).refused(403, "wrong_scope");
    let path = format!("/api/tokens/{}", made["item"]["id"].as_str().unwrap());
    let here = [("sec-fetch-site", "same-origin")];
    let sue = server.log_in("sue");
    server.raw("DELETE", &path, &sue, &here, vec![]).refused(404, "not_found");
    server.raw("DELETE", &path, &sam, &here, vec![]).expect(204);
    server.post("/api/products", &token, json!({"title": "too late"})).refused(401, "not_logged_in");
    server.post("/api/tokens", &sam, json!({"name": "x", "scopes": []})).refused(422, "no_scope");
    let zero = json!({"name": "x", "scopes": ["upload"], "expires_in_days": 0});
    server.post("/api/tokens", &sam, zero).refused(422, "bad_expiry");
}

#[test]
fn admins_make_and_lock_accounts() {
    let server = Server::start();
    let (ann, sam) = (server.log_in("ann"), server.log_in("sam"));
    let here = [("sec-fetch-site", "same-origin")];
    let new = json!({"name": "Zoë", "password": PASSWORD, "role": "seller"});
    server.post("/api/users", &sam, new.clone()).refused(403, "not_admin");
    let zoe = server.post("/api/users", &ann, new).expect(201).json();
    let again = json!({"name": "ZOË", "password": PASSWORD, "role": "seller"});
    server.post("/api/users", &ann, again).refused(409, "name_taken");
    let short = json!({"name": "max", "password": "short", "role": "seller"});
    server.post("/api/users", &ann, short).refused(422, "bad_password");
    let (session, token) = (server.log_in("Zoë"), server.manager("Zoë"));
    let path = format!("/api/users/{}", id_of(&zoe));
    server.send("PATCH", &path, &ann, &here, Some(json!({"disabled": true}))).expect(200);
    server.get("/api/manage/products", &session).refused(401, "not_logged_in");
    server.get("/api/manage/products", &token).refused(401, "not_logged_in");
    let users = server.get("/api/users", &ann).expect(200).json();
    assert_eq!(users["items"].as_array().unwrap().len(), 4);
    assert!(!users.to_string().contains("argon2"));
    let me = users["items"][0]["id"].as_str().unwrap().to_string();
    let demote =
        server.send("PATCH", &format!("/api/users/{me}"), &ann, &here, Some(json!({"role": "seller"})));
    demote.refused(409, "last_admin");
}

#[test]
fn a_new_password_ends_the_other_sessions() {
    let server = Server::start();
    let (one, other) = (server.log_in("sam"), server.log_in("sam"));
    let wrong = json!({"current": "wrong", "new": "another long password"});
    server.post("/api/account/password", &one, wrong).refused(403, "wrong_password");
    let right = json!({"current": PASSWORD, "new": "another long password"});
    let changed = server.post("/api/account/password", &one, right).expect(204);
    server.get("/api/manage/products", &other).refused(401, "not_logged_in");
    server.get("/api/manage/products", &Who::Cookie(cookie_of(&changed))).expect(200);
    let old = json!({"name": "sam", "password": PASSWORD});
    server.post("/api/session", &Who::Nobody, old).refused(401, "wrong_password");
}

#[test]
fn the_first_admins_link_works_once() {
    let server = Server::start();
    let link = server.block_on(async {
        server.app.db.replace_setup_link(&server::auth::secret::hash("old")).await.unwrap();
        server.app.db.replace_setup_link(&server::auth::secret::hash("fresh")).await.unwrap();
        "fresh"
    });
    let set_up = |token: &str, name: &str| {
        let body = json!({"token": token, "name": name, "password": PASSWORD});
        server.post("/api/setup", &Who::Nobody, body)
    };
    set_up("old", "first").refused(403, "link_used");
    set_up(link, "ann").refused(409, "name_taken");
    let answer = set_up(link, "first").expect(201);
    server.get("/api/users", &Who::Cookie(cookie_of(&answer))).expect(200);
    set_up(link, "second").refused(403, "link_used");
    let none = server.block_on(server::cli::setup_link(&server.app.db)).unwrap();
    assert!(none.is_none(), "no link where there is an admin");
}
