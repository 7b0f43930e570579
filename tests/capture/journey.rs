//! The seller's whole way over HTTP: sensor, board, views, preview, build, points away and back, publish, the next product.

use std::f64::consts::FRAC_PI_2;

use reconstruct::stream;
use scanner::recording::Recording;
use serde_json::{Value, json};

use super::daemon::Daemon;
use crate::story::Shop;

/// Seconds after a view in which its points must be in the preview.
const PREVIEW_SECONDS: f64 = 1.0;

#[test]
fn from_the_sensor_to_the_listing() {
    let (shop, out) = (Shop::open(), tempfile::tempdir().unwrap());
    let home = out.path().to_str().unwrap();
    let daemon = Daemon::start(&["capture", "--out", home, "--server", &format!("http://{}", shop.address)]);
    let state = daemon.state();
    assert_eq!((&state["step"], &state["sensors"][0]["address"]), (&json!("sensor"), &json!("simulated")));
    assert_eq!(state["server"], format!("http://{}", shop.address));
    assert_eq!(daemon.order("/api/sensor", &json!({"address": "simulated:mug"}))["step"], "board");
    let state = daemon.order("/api/board", &json!({"paper": "a3"}));
    assert_eq!((&state["step"], &state["board"]["tags"]), (&json!("views"), &json!(20)));

    take_views(&daemon, 4);
    undo_one(&daemon);
    let state = build(&daemon);
    assert_eq!(state["result"]["verdict"], "good", "{state}");
    let points = edit(&daemon);

    let folder = Recording::open(state["folder"].as_str().unwrap().as_ref()).unwrap().folder().to_owned();
    let leaving: Value = serde_json::from_slice(&daemon.get("/api/leaving").1).unwrap();
    let names: Vec<&str> =
        leaving["files"].as_array().unwrap().iter().map(|f| f["name"].as_str().unwrap()).collect();
    assert_eq!(names, ["report.json", "poster.png", "model.ply"]);
    for file in leaving["files"].as_array().unwrap() {
        let size = folder.join("model").join(file["name"].as_str().unwrap()).metadata().unwrap().len();
        assert_eq!(file["bytes"], size, "{file}");
    }
    publish(&daemon, &shop, &folder.join("model"), points);

    let state = daemon.order("/api/new", &json!({}));
    assert_eq!(
        (&state["step"], &state["views"], &state["result"]),
        (&json!("views"), &json!([]), &Value::Null)
    );
    take_views(&daemon, 1);
    assert_ne!(daemon.state()["folder"], folder.to_str().unwrap(), "a folder of its own");
    daemon.order("/api/quit", &json!({}));
    assert_eq!(daemon.ended(), Some(0));
}

fn take_views(daemon: &Daemon, count: usize) {
    for k in 0..count {
        daemon.stand_at(FRAC_PI_2 * k as f64);
        let before = daemon.state()["preview"]["points"].as_u64().unwrap_or(0);
        let state = daemon.order("/api/views", &json!({}));
        let view = &state["views"][k];
        assert_eq!((&view["frames"], &view["name"]), (&json!(10), &json!(format!("{k:03}"))), "{view}");
        let azimuth = view["azimuth"].as_f64().unwrap() - FRAC_PI_2 * k as f64;
        assert!(azimuth.sin().abs() < 0.1 && azimuth.cos() > 0.0, "{view}");
        assert!(state["preview"]["points"].as_u64().unwrap() > before, "the preview grows");
        let seconds = view["seconds"].as_f64().unwrap();
        println!(
            "view {k}: confirmed {seconds} s after the order (limit of the preview: {PREVIEW_SECONDS} s after the view)"
        );
    }
    let seen = daemon.state()["sectors"].as_array().unwrap().iter().filter(|s| s["seen"] == true).count();
    assert_eq!(seen, if count == 1 { 2 } else { 8 });
    let (status, preview) = daemon.get("/api/preview");
    let (header, _) = stream::decode(&preview).unwrap();
    assert_eq!((status, json!(header.points)), (200, daemon.state()["preview"]["points"].clone()));
}

/// The last view is taken back, its files go, and it is taken again.
fn undo_one(daemon: &Daemon) {
    let state = daemon.state();
    let files = std::path::Path::new(state["folder"].as_str().unwrap()).join("views/003");
    assert!(files.is_dir());
    assert_eq!(daemon.try_delete("/api/views/003").unwrap(), 200);
    assert_eq!(daemon.try_delete("/api/views/003").unwrap(), 404);
    assert!(!files.exists() && daemon.state()["views"].as_array().unwrap().len() == 3);
    assert!(daemon.state()["preview"]["points"].as_u64() < state["preview"]["points"].as_u64());
    daemon.order("/api/views", &json!({}));
    assert!(files.is_dir());
}

/// A build that is cancelled, then one to its end.
fn build(daemon: &Daemon) -> Value {
    assert_eq!(daemon.order("/api/build", &json!({}))["step"], "building");
    assert!(daemon.refused("/api/views", &json!({}), 409).contains("being built"));
    let state = daemon.order("/api/build/cancel", &json!({}));
    assert_eq!(
        (&state["step"], &state["build"], &state["result"]),
        (&json!("views"), &Value::Null, &Value::Null)
    );
    let state = daemon.order("/api/build", &json!({}));
    assert_eq!(state["build"]["of"], 8);
    let state = daemon.wait_for("the model", |state| state["step"] != "building");
    assert_eq!(state["step"], "result", "{state}");
    state
}

/// Removes every second point, takes it back, removes some for good; gives how many points are left.
fn edit(daemon: &Daemon) -> u64 {
    let model = || stream::decode(&daemon.get("/api/model").1).unwrap().1.vertices.points;
    let remove = |places: &[u32]| {
        let bytes: Vec<u8> = places.iter().flat_map(|place| place.to_le_bytes()).collect();
        daemon.post_bytes("/api/model/remove", "application/octet-stream", &bytes).unwrap()
    };
    let (all, built) = (model(), daemon.state()["result"].clone());
    // the stream has the invented vertices too
    let measured = built["points"].as_u64().unwrap() as usize;
    assert!(measured <= all.len() && measured * 10 > all.len() * 7, "{measured} of {}", all.len());
    let middle = all.iter().map(|p| p[2]).sum::<f32>() / all.len() as f32;
    let high: Vec<u32> = (0..all.len() as u32).filter(|&i| all[i as usize][2] > middle).collect();
    let (status, state) = remove(&high);
    // vertices that no triangle needs any more go too
    let removed = state["result"]["removed"].as_u64().unwrap() as usize;
    assert_eq!((status, removed), (200, all.len() - model().len()));
    assert!(removed >= high.len() && removed < high.len() + all.len() / 20, "{removed} of {}", high.len());
    assert!(model().iter().all(|p| p[2] <= middle + 1e-4), "the points that were meant");
    assert!(state["result"]["dimensions_m"][2].as_f64() < built["dimensions_m"][2].as_f64());
    let state = daemon.order("/api/model/undo", &json!({}));
    assert_eq!((&state["result"]["points"], &state["result"]["removed"]), (&built["points"], &json!(0)));
    assert_eq!(model(), all);
    assert_eq!(remove(&[all.len() as u32]).0, 422);
    assert_eq!(
        daemon.post_bytes("/api/model/remove", "application/octet-stream", &[1, 2, 3]).unwrap().0,
        422
    );
    let (status, state) = remove(&(0..100).collect::<Vec<_>>());
    let left = model().len();
    assert_eq!((status, &state["result"]["removed"]), (200, &json!(all.len() - left)));
    assert!((100..400).contains(&(all.len() - left)), "{left} of {}", all.len());
    assert_eq!(state["result"]["version"], built["version"].as_u64().unwrap() + 3);
    assert!(daemon.get("/api/poster").1.starts_with(b"\x89PNG"));
    left as u64
}

fn publish(daemon: &Daemon, shop: &Shop, model: &std::path::Path, points: u64) {
    let mut order = json!({"server": format!("http://{}", shop.address), "token": "arp_wrong", "title": "Blue mug",
        "description": "", "price_minor": 1234, "currency": "EUR", "category": "home", "condition": "like_new"});
    daemon.order("/api/publish", &order);
    let state = daemon.wait_for("the refusal", |state| state["step"] != "publishing");
    assert_eq!((&state["step"], &state["publish"]["phase"]), (&json!("result"), &json!("failed")));
    assert!(
        state["publish"]["error"].as_str().unwrap().contains("does not accept the upload token"),
        "{state}"
    );
    order["token"] = json!(shop.seller);
    daemon.order("/api/publish", &order);
    let state = daemon.wait_for("the listing", |state| state["step"] != "publishing");
    assert_eq!(
        (&state["step"], &state["publish"]["phase"]),
        (&json!("published"), &json!("done")),
        "{state}"
    );
    assert!(!state.to_string().contains(&shop.seller), "the token stays secret");
    assert_eq!(state["publish"]["sent_bytes"], state["publish"]["total_bytes"]);
    let address = state["publish"]["address"].as_str().unwrap();
    let id = address.rsplit('/').next().unwrap();
    assert_eq!(shop.activate(id, &shop.admin), 200);
    let product = shop.json(&format!("/api/products/{id}"), None);
    assert_eq!((&product["title"], &product["price_minor"]), (&json!("Blue mug"), &json!(1234)));
    let (_, sent) = shop.get(product["model"]["original_url"].as_str().unwrap(), None);
    assert_eq!(sent, std::fs::read(model.join("model.ply")).unwrap());
    let (_, bytes) = shop.get(product["model"]["stream_url"].as_str().unwrap(), None);
    assert_eq!(u64::from(stream::decode(&bytes).unwrap().0.points), points);
    let report: Value = serde_json::from_slice(&std::fs::read(model.join("report.json")).unwrap()).unwrap();
    let warnings = report["warnings"].as_array().unwrap().iter().filter_map(Value::as_str);
    let mut edited = warnings.filter(|w| w.starts_with("edited: ") && w.ends_with(" points removed"));
    assert!(edited.next().is_some(), "{}", report["warnings"]);
}
