//! What the page sees over the WebSocket: states as text, pictures as bytes.

use serde_json::{Value, json};
use tungstenite::Message;
use tungstenite::client::IntoClientRequest;

use super::daemon::Daemon;

/// Pictures looked at.
const PICTURES: usize = 40;

type Socket = tungstenite::WebSocket<tungstenite::stream::MaybeTlsStream<std::net::TcpStream>>;

fn connect(daemon: &Daemon, token: &str, origin: &str) -> Result<Socket, tungstenite::Error> {
    let address = format!("{}/api/live?token={token}", daemon.base.replace("http://", "ws://"));
    let mut request = address.into_client_request().unwrap();
    request.headers_mut().insert("origin", origin.parse().unwrap());
    Ok(tungstenite::connect(request)?.0)
}

/// Header, colour JPEG and depth JPEG of a picture.
fn parts(message: &[u8]) -> (Value, Vec<u8>, Vec<u8>) {
    let length = u32::from_le_bytes(message[..4].try_into().unwrap()) as usize;
    let header: Value = serde_json::from_slice(&message[4..4 + length]).unwrap();
    let color = header["color_bytes"].as_u64().unwrap() as usize;
    let rest = &message[4 + length..];
    assert_eq!(rest.len(), color + header["depth_bytes"].as_u64().unwrap() as usize);
    (header, rest[..color].to_vec(), rest[color..].to_vec())
}

#[test]
fn states_and_pictures_come_to_the_own_page_only() {
    let out = tempfile::tempdir().unwrap();
    let daemon = Daemon::capture(out.path(), "simulated:mug");
    daemon.order("/api/board", &json!({"paper": "a3"}));
    assert!(connect(&daemon, "0", &daemon.base).is_err());
    assert!(connect(&daemon, &daemon.token, "http://evil.example").is_err());
    let mut socket = connect(&daemon, &daemon.token, &daemon.base).unwrap();
    let Message::Text(first) = socket.read().unwrap() else { panic!("the state comes first") };
    let state: Value = serde_json::from_str(&first).unwrap();
    assert_eq!((&state["version"], &state["step"]), (&json!(1), &json!("views")));

    let (mut pictures, mut last, mut green) = (0, None, false);
    let started = std::time::Instant::now();
    while pictures < PICTURES {
        let Message::Binary(message) = socket.read().unwrap() else { continue };
        let (header, color, depth) = parts(&message);
        pictures += 1;
        assert!(header["index"].as_u64() > last, "pictures do not go back");
        last = header["index"].as_u64();
        assert!(color.starts_with(&[0xff, 0xd8]) && depth.starts_with(&[0xff, 0xd8]));
        assert!(
            header["tags"].as_array().unwrap().len() > 8 && header["region"].as_array().unwrap().len() == 4
        );
        green |= header["light"] == "green";
    }
    assert!(green, "a scene at rest becomes green");
    println!("{:.1} pictures a second", PICTURES as f64 / started.elapsed().as_secs_f64());

    daemon.order("/api/views", &json!({}));
    let taken = (0..1000).find_map(|_| match socket.read().unwrap() {
        Message::Text(text) => {
            let state: Value = serde_json::from_str(&text).unwrap();
            (state["views"].as_array().unwrap().len() == 1).then_some(state)
        }
        _ => None,
    });
    assert_eq!(taken.unwrap()["views"][0]["name"], "000");
    daemon.order("/api/quit", &json!({}));
    let closed = (0..1000).any(|_| matches!(socket.read(), Ok(Message::Close(_)) | Err(_)));
    assert!(closed);
    assert_eq!(daemon.ended(), Some(0));
}
