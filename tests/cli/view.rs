//! `abbe view`: the lock of its door, and what is behind it, over plain TCP.

use super::{bytes, command, fail, folder, json, succeed};
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::Path;
use std::process::{Child, Stdio};
use std::time::Duration;

/// A server that ends with the test.
pub struct Server {
    child: Child,
    pub host: String,
    token: String,
    cookie: String,
}

impl Drop for Server {
    fn drop(&mut self) {
        // one that has ended already is just as well
        _ = self.child.kill();
        _ = self.child.wait();
    }
}

/// An answer: status, head in lower case, body.
struct Answer {
    status: u16,
    head: String,
    body: Vec<u8>,
}

impl Answer {
    fn text(&self) -> String {
        String::from_utf8_lossy(&self.body).into_owned()
    }
}

impl Server {
    pub fn start(folder: &Path, arguments: &str) -> Self {
        let mut child = command(folder, &format!("view {arguments} --threads 2"))
            .stdout(Stdio::piped())
            .spawn()
            .expect("runs");
        let told = child.stdout.take().expect("piped");
        Self::of(child, BufReader::new(told))
    }

    /// The server of a process that tells its address first.
    fn of(child: Child, mut told: impl BufRead) -> Self {
        let mut line = String::new();
        told.read_line(&mut line).expect("an address");
        let address = line.trim().strip_prefix("http://").expect("an address");
        let (host, token) = address.split_once("/#").expect("a token in the fragment");
        assert!(host.starts_with("127.0.0.1:"), "{host}");
        let mut server = Self {
            child,
            host: host.to_owned(),
            token: token.to_owned(),
            cookie: String::new(),
        };
        let answer = server.post("/session", token);
        assert_eq!(answer.status, 200, "{}", answer.text());
        let cookie = answer.head.split("set-cookie: ").nth(1).expect("a cookie");
        let attributes = cookie.lines().next().expect("a line");
        for attribute in ["; httponly", "; samesite=strict"] {
            assert!(attributes.contains(attribute), "{attributes}");
        }
        cookie
            .split(';')
            .next()
            .expect("a value")
            .clone_into(&mut server.cookie);
        server
    }

    /// The address as it is printed.
    pub fn address(&self) -> String {
        format!("http://{}/#{}", self.host, self.token)
    }

    /// Sends bytes as they are.
    fn send(&self, request: &[u8]) -> Answer {
        let mut stream = TcpStream::connect(&self.host).expect("connects");
        stream.write_all(request).expect("writes");
        let mut all = Vec::new();
        stream.read_to_end(&mut all).expect("reads");
        let end = all.windows(4).position(|w| w == b"\r\n\r\n");
        let end = end.unwrap_or_else(|| panic!("no head: {}", String::from_utf8_lossy(&all)));
        let head = String::from_utf8_lossy(&all[..end]).to_lowercase();
        Answer {
            status: head
                .split(' ')
                .nth(1)
                .and_then(|s| s.parse().ok())
                .expect("status"),
            head,
            body: all[end + 4..].to_vec(),
        }
    }

    fn request(&self, line: &str, headers: &[(&str, &str)], body: &str) -> Answer {
        let mut text = format!("{line} HTTP/1.1\r\n");
        for (name, value) in headers {
            text += &format!("{name}: {value}\r\n");
        }
        text += &format!("Content-Length: {}\r\n\r\n{body}", body.len());
        self.send(text.as_bytes())
    }

    fn get(&self, path: &str) -> Answer {
        let headers = [("Host", &*self.host), ("Cookie", &*self.cookie)];
        self.request(&format!("GET {path}"), &headers, "")
    }

    fn post(&self, path: &str, body: &str) -> Answer {
        let origin = format!("http://{}", self.host);
        let headers = [
            ("Host", &*self.host),
            ("Origin", &*origin),
            ("Cookie", &*self.cookie),
        ];
        self.request(&format!("POST {path}"), &headers, body)
    }

    fn state(&self) -> serde_json::Value {
        let answer = self.get("/state");
        assert_eq!(answer.status, 200, "{}", answer.text());
        json(&answer.text())
    }

    /// Waits for a state, however long it takes.
    fn wait(&self, is_there: impl Fn(&serde_json::Value) -> bool) -> serde_json::Value {
        loop {
            let state = self.state();
            if is_there(&state) {
                return state;
            }
            std::thread::sleep(Duration::from_millis(20));
        }
    }

    fn wait_for(&self, phase: &str, version: u64) -> serde_json::Value {
        self.wait(|s| s["phase"] == phase && s["stage"]["version"].as_u64() >= Some(version))
    }
}

#[test]
fn only_the_page_with_the_token_gets_in() {
    let dir = folder();
    let server = Server::start(dir.path(), "scene.toml --spp 1");
    let (host, cookie) = (server.host.as_str(), server.cookie.as_str());
    assert_eq!(server.token.len(), 32);
    let own = format!("http://{host}");
    // the page itself is public and holds nothing
    let page = server.request("GET /", &[("Host", host)], "");
    assert_eq!(page.status, 200);
    for header in [
        "content-security-policy: default-src 'self';",
        "referrer-policy: no-referrer",
        "cache-control: no-store",
        "x-content-type-options: nosniff",
        "frame-ancestors 'none'",
    ] {
        assert!(page.head.contains(header), "{header}: {}", page.head);
    }
    for path in ["/view.js", "/plot.js", "/view.css"] {
        assert_eq!(
            server
                .request(&format!("GET {path}"), &[("Host", host)], "")
                .status,
            200
        );
    }
    let text = page.text() + &server.get("/view.js").text() + &server.get("/view.css").text();
    for elsewhere in ["http://", "https://", "//cdn", "@import", &server.token] {
        assert!(!text.contains(elsewhere), "{elsewhere}");
    }
    // without the cookie, or with a wrong one
    for path in [
        "/state",
        "/picture.png",
        "/pixel?x=0&y=0",
        "/save.exr",
        "/save.png",
        "/none",
    ] {
        let line = format!("GET {path}");
        assert_eq!(
            server.request(&line, &[("Host", host)], "").status,
            401,
            "{path}"
        );
        let name = cookie.split('=').next().expect("a name");
        for wrong in [
            format!("{name}="),
            format!("{name}={}", server.token),
            "a=b".to_owned(),
        ] {
            let headers = [("Host", host), ("Cookie", &*wrong)];
            assert_eq!(
                server.request(&line, &headers, "").status,
                401,
                "{path} {wrong}"
            );
        }
    }
    // wrong tokens
    for token in ["", "0", &"0".repeat(32), &server.token[1..]] {
        let answer = server.post("/session", token);
        assert_eq!(answer.status, 401, "{token}");
        assert!(!answer.head.contains("set-cookie"), "{}", answer.head);
    }
    // names that may lead here, other pages, and requests that say nothing of themselves
    let port = host.split(':').nth(1).expect("a port");
    let named = format!("localhost:{port}");
    for strange in ["evil.example", &named, "127.0.0.1", "127.0.0.1:1", ""] {
        for line in ["GET /", "GET /state"] {
            let headers = [("Host", strange), ("Cookie", cookie)];
            assert_eq!(
                server.request(line, &headers, "").status,
                403,
                "{line} {strange}"
            );
        }
    }
    assert_eq!(
        server
            .request("GET /state", &[("Cookie", cookie)], "")
            .status,
        403
    );
    let twice = [("Host", host), ("Host", "evil.example"), ("Cookie", cookie)];
    assert_eq!(server.request("GET /state", &twice, "").status, 403);
    for strange in [
        "http://evil.example",
        "null",
        &format!("https://{host}"),
        &format!("http://{named}"),
    ] {
        for line in ["GET /state", "POST /settings", "POST /session"] {
            let headers = [("Host", host), ("Origin", strange), ("Cookie", cookie)];
            assert_eq!(
                server.request(line, &headers, "{}").status,
                403,
                "{line} {strange}"
            );
        }
    }
    let silent = [("Host", host), ("Cookie", cookie)];
    assert_eq!(server.request("POST /settings", &silent, "{}").status, 403);
    for (site, status) in [
        ("same-origin", 200),
        ("none", 200),
        ("cross-site", 403),
        ("same-site", 403),
    ] {
        let headers = [
            ("Host", host),
            ("Origin", &*own),
            ("Sec-Fetch-Site", site),
            ("Cookie", cookie),
        ];
        assert_eq!(
            server.request("GET /state", &headers, "").status,
            status,
            "{site}"
        );
    }
    assert_eq!(server.get("/state").status, 200);
    assert_eq!(server.get("/scene.toml").status, 404);
    assert_eq!(server.get("/../scene.toml").status, 404);
}

#[test]
fn sizes_are_limited() {
    let dir = folder();
    let server = Server::start(dir.path(), "scene.toml --spp 1");
    assert_eq!(server.post("/settings", &" ".repeat(4097)).status, 413);
    let long = "x".repeat(9000);
    assert_eq!(server.get(&format!("/{long}")).status, 431);
    assert_eq!(
        server
            .send(b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\r\n\r\n")
            .status,
        400
    );
    // of more connections than it takes none is answered, and those before go on
    let held: Vec<TcpStream> = (0..16)
        .map(|_| TcpStream::connect(&server.host).expect("connects"))
        .collect();
    let mut late = TcpStream::connect(&server.host).expect("connects");
    // closed, or reset where it had not read what was sent
    _ = late.write_all(b"GET / HTTP/1.1\r\n\r\n");
    let mut answer = Vec::new();
    _ = late.read_to_end(&mut answer);
    assert!(answer.is_empty(), "{}", String::from_utf8_lossy(&answer));
    drop(held);
    while TcpStream::connect(&server.host).is_ok_and(|mut stream| {
        let request = format!("GET / HTTP/1.1\r\nHost: {}\r\n\r\n", server.host);
        let mut answer = String::new();
        stream.write_all(request.as_bytes()).is_err()
            || stream.read_to_string(&mut answer).is_err()
            || answer.is_empty()
    }) {
        std::thread::sleep(Duration::from_millis(20));
    }
    assert_eq!(server.get("/state").status, 200);
}

#[test]
fn what_is_saved_has_the_bytes_of_the_command_line() {
    let dir = folder();
    succeed(dir.path(), "render scene.toml -q --spp 6 -o a.exr");
    succeed(
        dir.path(),
        "develop a.exr -q --exposure 1.5 --tone agx --white 3200K -o b.png",
    );
    succeed(
        dir.path(),
        "render scene.toml -q --spp 6 --integrator path --lanes 8 -o c.exr",
    );
    let server = Server::start(dir.path(), "scene.toml --spp 6");
    let state = server.wait_for("done", 1);
    assert_eq!(state["passes"], 6);
    assert_eq!(state["stage"]["name"], "scene.toml: camera");
    assert!(state["error"].as_f64().is_some_and(|e| e > 0.0), "{state}");
    let saved = server.get("/save.exr");
    assert!(
        saved
            .head
            .contains("content-disposition: attachment; filename=\"abbe.exr\"")
    );
    assert!(saved.body == bytes(&dir, "a.exr"), "the images differ");
    let picture = "exposure=1.5&tone=agx&white=3200K";
    for path in ["save.png", "picture.png"] {
        let found = server.get(&format!("/{path}?{picture}"));
        assert!(
            found.body == bytes(&dir, "b.png"),
            "{path}: the pictures differ"
        );
    }
    assert!(server.get("/picture.png").body == bytes(&dir, "a.png"));
    // a pixel, as the image has it
    let image = abbe::io::exr::read(&dir.path().join("a.exr")).expect("reads");
    let pixel = json(&server.get("/pixel?x=5&y=7").text());
    for (c, name) in ["X", "Y", "Z"].iter().enumerate() {
        let value = image.channel(name).expect("channel")[7 * 24 + 5];
        assert_eq!(pixel["xyz"][c].as_f64().map(|v| v as f32), Some(value));
    }
    assert_eq!(pixel["unit"], "cd/m²");
    // its spectrum has its luminance: Y is the mean over the observer, here from 24 bins
    let list = |key: &str| -> Vec<f64> {
        let values = pixel["spectrum"][key].as_array().expect("a list");
        values
            .iter()
            .map(|v| v.as_f64().expect("a number"))
            .collect()
    };
    let (nm, values) = (list("nm"), list("values"));
    assert_eq!((nm.len(), values.len()), (24, 24));
    let pairs = || nm.iter().zip(&values);
    let y: f64 = pairs()
        .map(|(nm, v)| v * abbe::spectrum::xyz::cmf(*nm)[1])
        .sum();
    let white: f64 = nm.iter().map(|nm| abbe::spectrum::xyz::cmf(*nm)[1]).sum();
    let expected = pixel["xyz"][1].as_f64().expect("a number");
    assert!(
        (y / white / expected - 1.0).abs() < 0.1,
        "{y} {white} {expected}"
    );
    // the error of the image as a picture of its own; other layers are not there
    assert_ne!(
        server.get("/picture.png?layer=error").body,
        bytes(&dir, "a.png")
    );
    for wrong in [
        "layer=depth",
        "exposure=x",
        "exposure=1e9",
        "tone=x",
        "white=x",
    ] {
        assert_eq!(
            server.get(&format!("/picture.png?{wrong}")).status,
            400,
            "{wrong}"
        );
    }
    assert_eq!(server.get("/pixel?x=24&y=0").status, 204);
    assert_eq!(server.get("/pixel?x=a").status, 400);
    // a snapshot stays while other settings are rendered
    assert_eq!(server.get("/picture.png?of=snapshot").status, 204);
    assert_eq!(server.post("/snapshot", "").status, 200);
    let settings =
        r#"{"integrator":"path","lanes":8,"aim":"off","regularize":"auto","epsilon":null}"#;
    assert_eq!(server.post("/settings", settings).status, 200);
    let state = server.wait_for("done", 2);
    assert_eq!(state["stage"]["settings"]["integrator"], "path");
    let text = "bdpt, regularize auto, aim auto, 4 lanes, 6 passes";
    assert_eq!(state["snapshot"], text);
    assert!(
        server.get("/save.exr").body == bytes(&dir, "c.exr"),
        "the images differ"
    );
    assert!(server.get("/picture.png?of=snapshot").body == bytes(&dir, "a.png"));
    for wrong in [
        r#"{"spp":1}"#,
        r#"{"scene":"/etc/passwd"}"#,
        r#"{"lanes":3}"#,
        "x",
    ] {
        assert_eq!(server.post("/settings", wrong).status, 400, "{wrong}");
    }
    // and it has written nothing
    let files = std::fs::read_dir(dir.path()).expect("folder");
    assert_eq!(files.count(), 6);
}

#[test]
fn layers_are_those_of_the_command_line_and_those_chosen() {
    let dir = folder();
    let aov = "class:^LDE$,unbiased,depth";
    succeed(
        dir.path(),
        &format!("render scene.toml -q --spp 4 --aov {aov} -o a.exr"),
    );
    succeed(
        dir.path(),
        &format!("render scene.toml -q --spp 4 --aov {aov},strategies -o b.exr"),
    );
    for layer in ["class0", "depth", "s1t2"] {
        // depths have no exposure of their own in the page: they are shown as measured
        let how = if layer == "depth" {
            "--tone linear --exposure 2"
        } else {
            "--exposure 2"
        };
        succeed(
            dir.path(),
            &format!("develop b.exr -q --layer {layer} {how} -o {layer}.png"),
        );
    }
    let server = Server::start(dir.path(), &format!("scene.toml --spp 4 --aov {aov}"));
    let state = server.wait_for("done", 1);
    let expected = ["error", "class0", "unbiased", "depth"];
    assert_eq!(state["stage"]["layers"], serde_json::json!(expected));
    assert_eq!(state["stage"]["settings"]["strategies"], false);
    assert_eq!(state["stage"]["settings"]["shares"], true);
    assert!(
        server.get("/save.exr").body == bytes(&dir, "a.exr"),
        "the images differ"
    );
    assert_eq!(server.get("/picture.png?layer=s1t2").status, 400);
    assert_eq!(
        server.post("/settings", r#"{"strategies":true}"#).status,
        200
    );
    let state = server.wait_for("done", 2);
    let layers = state["stage"]["layers"].as_array().expect("a list");
    assert!(
        layers.len() > 8 && layers.contains(&"s1t2".into()),
        "{layers:?}"
    );
    assert!(
        server.get("/save.exr").body == bytes(&dir, "b.exr"),
        "the images differ"
    );
    for layer in ["class0", "depth", "s1t2"] {
        let found = server.get(&format!("/picture.png?layer={layer}&exposure=2"));
        assert_eq!(found.status, 200, "{layer}");
        assert!(
            found.body == bytes(&dir, &format!("{layer}.png")),
            "{layer}: the pictures differ"
        );
    }
    // what a layer needs is told
    let server = Server::start(dir.path(), "scene.toml --spp 1 --aov bias");
    let state = server.wait(|s| !s["problem"].is_null());
    let problem = state["problem"].as_str().expect("text");
    assert!(problem.contains("bias_estimate"), "{problem}");
    assert!(
        fail(dir.path(), "view scene.toml --aov grain", 2)
            .contains("expected error, noise, strategies")
    );
}

#[test]
fn a_scene_that_changes_is_rendered_anew() {
    let dir = folder();
    let server = Server::start(dir.path(), "scene.toml --spp 2");
    server.wait_for("done", 1);
    let path = dir.path().join("scene.toml");
    let text = std::fs::read_to_string(&path).expect("reads");
    // what is wrong is told, and the picture stays
    std::fs::write(&path, text.replace("radius = 0.6", "radius = -10.6")).expect("writes");
    let state = server.wait(|s| !s["problem"].is_null());
    let problem = state["problem"].as_str().expect("text");
    assert!(problem.contains("scene.toml:"), "{problem}");
    assert_eq!(state["stage"]["version"], 1);
    assert_eq!(server.get("/picture.png").status, 200);
    std::fs::write(&path, text.replace("radius = 0.6", "radius = 0.45")).expect("writes");
    let state = server.wait_for("done", 2);
    assert!(state["problem"].is_null(), "{state}");
    succeed(dir.path(), "render scene.toml -q --spp 2 -o a.exr");
    assert!(
        server.get("/save.exr").body == bytes(&dir, "a.exr"),
        "the images differ"
    );
}

#[test]
fn images_are_looked_at_as_they_are() {
    let dir = folder();
    succeed(
        dir.path(),
        "render scene.toml -q --spp 2 -o a.exr --part a.part",
    );
    for file in ["a.exr", "a.part"] {
        let server = Server::start(dir.path(), file);
        let state = server.wait_for("image", 1);
        assert_eq!(state["stage"]["renders"], false);
        assert!(server.get("/picture.png").body == bytes(&dir, "a.png"));
        assert_eq!(server.post("/settings", "{}").status, 400);
        let pixel = json(&server.get("/pixel?x=1&y=2").text());
        assert!(
            pixel["spectrum"].is_null() && pixel["luminance"].is_number(),
            "{pixel}"
        );
    }
    assert!(fail(dir.path(), "view none.toml", 1).contains("none.toml: there is no such file"));
}

#[test]
fn a_reference_stands_left_of_the_line_from_the_beginning() {
    let dir = folder();
    succeed(dir.path(), "render scene.toml -q --spp 2 -o a.exr");
    succeed(
        dir.path(),
        "render scene.toml -q --spp 1 -o small.exr --set sensor.0.resolution=[8,6]",
    );
    let server = Server::start(dir.path(), "scene.toml --spp 1 --against a.exr");
    let state = server.wait_for("done", 1);
    assert_eq!(state["snapshot"], "reference: a.exr");
    assert!(server.get("/picture.png?of=snapshot").body == bytes(&dir, "a.png"));
    assert!(server.get("/picture.png").body != bytes(&dir, "a.png"));
    drop(server);
    // of another size it is told, whatever is looked at
    for subject in ["scene.toml", "a.exr"] {
        let server = Server::start(dir.path(), &format!("{subject} --against small.exr"));
        let state = server.wait(|s| !s["problem"].is_null());
        let expected = "small.exr: has 8 x 6 pixels, the picture 24 x 16";
        assert_eq!(state["problem"], expected, "{subject}");
        assert_eq!(state["phase"], "stopped");
    }
    let error = fail(dir.path(), "view scene.toml --against scene.toml", 1);
    assert!(error.starts_with("error: scene.toml: "), "{error}");
}

#[test]
fn a_job_is_shown_as_far_as_it_is_done() {
    let dir = folder();
    succeed(dir.path(), "job new scene.toml -o job --spp 4 --chunk 2");
    let server = Server::start(dir.path(), "job");
    let state = server.wait(|s| !s["problem"].is_null());
    assert_eq!(state["problem"], "job: no chunk is done yet");
    succeed(dir.path(), "job run job --threads 1 -q");
    let state = server.wait(|s| s["passes"] == 4);
    assert_eq!(state["all"], 4);
    assert!(state["problem"].is_null(), "{state}");
    succeed(dir.path(), "job collect job -o whole.exr -q");
    assert!(server.get("/picture.png").body == bytes(&dir, "whole.png"));
    std::fs::create_dir(dir.path().join("other")).expect("folder");
    let error = fail(dir.path(), "view other", 1);
    assert!(error.contains("no job (a folder with job.json)"), "{error}");
}

#[test]
fn pixels_of_a_detector_have_a_size() {
    let dir = folder();
    let text = std::fs::read_to_string(dir.path().join("scene.toml")).expect("reads");
    let text = format!(
        "{text}[[sensor]]\nname = \"plate\"\nresolution = [10, 5]\n\
         detector = {{ center = [0, 0, 2], u = [0.5, 0, 0], v = [0, 0.5, 0] }}\n"
    );
    std::fs::write(dir.path().join("two.toml"), text).expect("writes");
    succeed(
        dir.path(),
        "render two.toml -q --spp 1 --sensor plate -o plate.exr",
    );
    let image = abbe::io::exr::read(&dir.path().join("plate.exr")).expect("reads");
    let Some(abbe::io::exr::MetadataValue::Text(flux)) = image.metadata.get("flux") else {
        panic!("no flux");
    };
    let flux = flux.to_lowercase();
    assert!(flux.ends_with(" lm"), "{flux}");
    for (subject, phase) in [
        ("two.toml --spp 1 --sensor plate", "done"),
        ("plate.exr", "image"),
    ] {
        let server = Server::start(dir.path(), subject);
        let state = server.wait_for(phase, 1);
        let pitch = state["stage"]["pitch"].as_array().expect("a pitch");
        let pitch: Vec<f64> = pitch.iter().filter_map(serde_json::Value::as_f64).collect();
        assert_eq!(pitch, [0.1, 0.2], "{subject}");
        // cross-sections through a pixel, and the flux that the image tells
        let pixel = json(&server.get("/pixel?x=3&y=2").text());
        let (row, column) = (&pixel["sections"]["row"], &pixel["sections"]["column"]);
        assert_eq!((row[3].clone(), column[2].clone()), {
            let here = pixel["luminance"].clone();
            (here.clone(), here)
        });
        let lengths = [row, column].map(|list| list.as_array().map(Vec::len));
        assert_eq!(lengths, [Some(10), Some(5)]);
        let told = server.get("/picture.png").head;
        let told = told.split("x-flux: ").nth(1).and_then(|t| t.lines().next());
        assert_eq!(told, Some(&*flux), "{subject}");
    }
    let server = Server::start(dir.path(), "two.toml --spp 1");
    assert!(server.wait_for("done", 1)["stage"]["pitch"].is_null());
    assert!(json(&server.get("/pixel?x=3&y=2").text())["sections"].is_null());
}

#[test]
fn a_render_shows_what_it_writes() {
    let dir = folder();
    let render = "render scene.toml --spp 4000000 --view --aov regularized -q --threads 2 -o a.exr";
    let mut child = command(dir.path(), render)
        .stderr(Stdio::piped())
        .spawn()
        .expect("runs");
    let told = child.stderr.take().expect("piped");
    let mut server = Server::of(child, BufReader::new(told));
    let state = server.wait(|s| s["passes"].as_u64() > Some(1));
    assert_eq!(state["phase"], "rendering");
    assert_eq!(state["stage"]["name"], "scene.toml: camera");
    // its settings stay as they are, and its layers are there
    assert_eq!(state["stage"]["renders"], false);
    assert_eq!(
        state["stage"]["layers"],
        serde_json::json!(["error", "regularized"])
    );
    assert_eq!(server.post("/settings", "{}").status, 400);
    let saved = server.get("/save.exr").body;
    assert!(saved.starts_with(&[0x76, 0x2f, 0x31, 0x01]));
    let pixel = json(&server.get("/pixel?x=5&y=7").text());
    assert!(
        pixel["xyz"][1].as_f64().is_some_and(|y| y >= 0.0),
        "{pixel}"
    );
    #[cfg(unix)]
    {
        let mut kill = std::process::Command::new("kill");
        let pid = server.child.id().to_string();
        assert!(kill.args(["-INT", &pid]).status().expect("runs").success());
        let code = server.child.wait().expect("ends").code();
        assert_eq!(code, Some(130));
        assert!(dir.path().join("a.exr").exists());
    }
}
