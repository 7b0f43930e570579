//! Listings: their life, who sees them, and two people editing at once.

use serde_json::json;

use super::support::{Server, Who, id_of};

#[test]
fn from_draft_to_public_and_back() {
    let server = Server::start();
    let (sam, ann) = (server.log_in("sam"), server.log_in("ann"));
    let here = [("sec-fetch-site", "same-origin")];
    let body = json!({"title": "  Blue mug ", "description": "A mug.\nBlue.", "price_minor": 2500, "currency": "EUR",
                      "category": "home", "condition": "like_new"});
    let draft = server.post("/api/products", &sam, body).expect(201);
    assert_eq!(draft.header("etag"), "\"v1\"");
    let draft = draft.json();
    assert_eq!((&draft["title"], &draft["status"]), (&json!("Blue mug"), &json!("draft")));
    let path = format!("/api/products/{}", id_of(&draft));
    server.get(&path, &Who::Nobody).refused(404, "not_found");
    let status = |who: &Who, to: &str| server.post(&format!("{path}/status"), who, json!({"status": to}));
    status(&sam, "active").refused(403, "not_admin");
    status(&ann, "active").refused(409, "no_model");
    server.raw("PUT", &format!("{path}/model"), &sam, &here, super::support::ASC.into()).expect(200);
    status(&ann, "active").expect(200);
    let public = server.get(&path, &Who::Nobody).expect(200).json();
    assert_eq!(public["model"]["points"], 3);
    assert_eq!(public["model"]["bounds_m"]["max"], json!([0.01, 0.02, 0.005]));
    assert_eq!(server.get("/api/products?q=BLUE%20mug&category=home", &Who::Nobody).json()["total"], 1);
    server.raw("DELETE", &path, &sam, &here, vec![]).refused(409, "active");
    status(&sam, "archived").expect(200);
    server.get(&path, &Who::Nobody).refused(404, "not_found");
    assert_eq!(server.get("/api/products", &Who::Nobody).json()["total"], 0);
    assert!(!server.stored().is_empty());
    server.raw("DELETE", &path, &sam, &here, vec![]).expect(204);
    server.get(&path, &sam).refused(404, "not_found");
    assert!(server.stored().is_empty(), "{:?}", server.stored());
}

#[test]
fn another_sellers_listing_does_not_exist() {
    let server = Server::start();
    let (sam, sue) = (server.manager("sam"), server.manager("sue"));
    let id = server.draft_with_model(&sam, "sam's");
    let path = format!("/api/products/{id}");
    let stream = server.get(&path, &sam).json()["model"]["stream_url"].as_str().unwrap().to_string();
    server.get(&path, &sue).refused(404, "not_found");
    server.get(&stream, &sue).refused(404, "not_found");
    server.get(&stream, &Who::Nobody).refused(404, "not_found");
    server
        .send("PATCH", &path, &sue, &[("if-match", "*")], Some(json!({"title": "mine"})))
        .refused(404, "not_found");
    server.post(&format!("{path}/status"), &sue, json!({"status": "archived"})).refused(404, "not_found");
    server.raw("DELETE", &path, &sue, &[], vec![]).refused(404, "not_found");
    for kind in ["model", "poster", "report"] {
        server.raw("PUT", &format!("{path}/{kind}"), &sue, &[], b"x".into()).refused(404, "not_found");
    }
    assert_eq!(server.get("/api/manage/products", &sue).json()["total"], 0);
    assert_eq!(server.get("/api/manage/products", &server.manager("ann")).json()["total"], 1);
    server.get(&path, &server.manager("ann")).expect(200);
    server.get(&path, &Who::Nobody).refused(404, "not_found");
}

#[test]
fn of_two_edits_at_once_the_second_is_told() {
    let server = Server::start();
    let sam = server.manager("sam");
    let path = format!("/api/products/{}", id_of(&server.draft(&sam, "old")));
    let edit = |title: &str, version: &str| {
        server.send("PATCH", &path, &sam, &[("if-match", version)], Some(json!({"title": title})))
    };
    server.send("PATCH", &path, &sam, &[], Some(json!({"title": "x"}))).refused(428, "if_match_missing");
    let (one, other) = std::thread::scope(|scope| {
        let one = scope.spawn(|| edit("one", "\"v1\"").status);
        let other = scope.spawn(|| edit("other", "\"v1\"").status);
        (one.join().unwrap(), other.join().unwrap())
    });
    assert!(matches!((one, other), (200, 412) | (412, 200)), "{one} {other}");
    edit("late", "\"v1\"").refused(412, "edited_meanwhile");
    edit("weird", "W/\"x\"").refused(412, "edited_meanwhile");
    let now = server.get(&path, &sam);
    assert_eq!(now.json()["title"], if one == 200 { "one" } else { "other" });
    assert_eq!(edit("third", now.header("etag")).expect(200).header("etag"), "\"v3\"");
}

#[test]
fn edits_change_only_what_they_name() {
    let server = Server::start();
    let sam = server.manager("sam");
    let body =
        json!({"title": "t", "description": "d", "price_minor": 100, "currency": "EUR", "condition": "fair"});
    let path =
        format!("/api/products/{}", id_of(&server.post("/api/products", &sam, body).expect(201).json()));
    let edit = |body| server.send("PATCH", &path, &sam, &[("if-match", "*")], Some(body));
    let after = edit(json!({"price_minor": 250})).expect(200).json();
    assert_eq!(
        (&after["price_minor"], &after["currency"], &after["description"]),
        (&json!(250), &json!("EUR"), &json!("d"))
    );
    let after = edit(json!({"price_minor": null, "currency": null, "condition": null})).expect(200).json();
    assert!(after["price_minor"].is_null() && after["condition"].is_null());
    edit(json!({"price_minor": 5})).refused(422, "bad_field");
}

#[test]
fn html_stays_text_and_nonsense_is_refused() {
    let server = Server::start();
    let sam = server.manager("sam");
    let title = "<script>alert(1)</script> & \"mug\"";
    let made = server.post("/api/products", &sam, json!({"title": title})).expect(201);
    assert_eq!(made.header("content-type"), "application/json");
    assert_eq!(made.json()["title"], title);
    for body in [
        json!({"title": ""}),
        json!({"title": "a\u{0}b"}),
        json!({"title": "x".repeat(201)}),
        json!({"title": "x", "price_minor": 5}),
        json!({"title": "x", "price_minor": -5, "currency": "EUR"}),
        json!({"title": "x", "price_minor": 5, "currency": "eur"}),
    ] {
        server.post("/api/products", &sam, body).refused(422, "bad_field");
    }
    for body in [json!({}), json!([]), json!({"title": 5}), json!({"title": "x", "category": "weapons"})] {
        server.post("/api/products", &sam, body).refused(422, "bad_json");
    }
    let deep = [("content-type", "application/json")];
    server.raw("POST", "/api/products", &sam, &deep, "[".repeat(60_000).into()).refused(422, "bad_json");
    server.raw("POST", "/api/products", &sam, &deep, vec![b' '; 100_000]).refused(413, "too_large");
    server.raw("POST", "/api/products", &sam, &[], b"{}".into()).refused(415, "wrong_content_type");
    for id in ["..", "%2e%2e", "x", "' or 1=1 --", "00000000-0000-0000-0000-000000000000"] {
        let path = format!("/api/products/{}", id.replace(' ', "%20"));
        assert_eq!(server.get(&path, &sam).status, 404, "{id}");
    }
}

#[test]
fn the_gallery_searches_sorts_and_pages() {
    let server = Server::start();
    let sam = server.manager("sam");
    for (n, title) in ["Äpfel 100%", "Birne_x", "Citrus", "Birne"].iter().enumerate() {
        let id = id_of(&server.active(&sam, title));
        let price = json!({"price_minor": 100 * (n + 1), "currency": "EUR"});
        server
            .send("PATCH", &format!("/api/products/{id}"), &sam, &[("if-match", "*")], Some(price))
            .expect(200);
    }
    server.draft(&sam, "Birne draft");
    let titles = |query: &str| -> Vec<String> {
        let page = server.get(&format!("/api/products?{query}"), &Who::Nobody).expect(200).json();
        page["items"].as_array().unwrap().iter().map(|item| item["title"].as_str().unwrap().into()).collect()
    };
    assert_eq!(titles(""), ["Birne", "Citrus", "Birne_x", "Äpfel 100%"]);
    assert_eq!(titles("sort=price_asc&per_page=2"), ["Äpfel 100%", "Birne_x"]);
    assert_eq!(titles("sort=price_desc&per_page=2&page=2"), ["Birne_x", "Äpfel 100%"]);
    assert_eq!(titles("q=%C3%84PFEL"), ["Äpfel 100%"]);
    assert_eq!(titles("q=%25"), ["Äpfel 100%"]);
    assert_eq!(titles("q=_"), ["Birne_x"]);
    assert_eq!(titles("category=books"), [""; 0]);
    assert_eq!(titles("page=99999999999"), [""; 0]);
    assert_eq!(titles("per_page=-5&category="), ["Birne"]);
    let categories = server.get("/api/products", &Who::Nobody).json()["categories"].clone();
    assert_eq!(categories, json!([{"name": "other", "count": 4}]));
    server.get("/api/products?sort=upwards", &Who::Nobody).refused(400, "bad_query");
    let drafts = server.get("/api/manage/products?status=draft", &sam).expect(200).json();
    assert_eq!(drafts["items"][0]["title"], "Birne draft");
}
