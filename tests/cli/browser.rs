//! The page of `abbe view` in a browser without a window, by clicks and keys (the Chrome `DevTools`
//! protocol over two pipes). Asserts states, however long they take to come. Without a Chromium
//! there is nothing to test. `ABBE_SCREENSHOTS=FOLDER` keeps pictures of the page, to be looked at.

use super::view::Server;
use super::{folder, succeed};
use serde_json::{Value, json};
use std::io::{BufRead, BufReader, Write};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use std::time::Duration;
use tempfile::TempDir;

/// A browser that ends with the test, its profile in a folder of its own.
struct Browser {
    child: Child,
    commands: ChildStdin,
    answers: BufReader<ChildStdout>,
    last: u64,
    /// Events that pages have told since they were opened.
    events: Vec<Value>,
    _profile: TempDir,
}

impl Drop for Browser {
    fn drop(&mut self) {
        _ = self.child.kill();
        _ = self.child.wait();
    }
}

/// Programs by which Chromium goes, started with a pipe for commands and one for answers.
const START: &str = "
    for name in chromium chromium-browser google-chrome; do
        if command -v $name >/dev/null; then
            exec $name --headless --no-sandbox --disable-gpu --no-first-run --disable-extensions \\
                --disable-background-networking --disable-dev-shm-usage --user-data-dir=\"$1\" \\
                --remote-debugging-pipe about:blank 3<&0 4>&1 </dev/null >/dev/null 2>/dev/null
        fi
    done";

impl Browser {
    /// `None` where there is no Chromium.
    fn start() -> Option<Self> {
        let profile = tempfile::tempdir().expect("temporary folder");
        let mut child = Command::new("sh")
            .args(["-c", START, "sh"])
            .arg(profile.path())
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .expect("runs");
        let (commands, answers) = (child.stdin.take(), child.stdout.take());
        let mut browser = Self {
            child,
            commands: commands.expect("piped"),
            answers: BufReader::new(answers.expect("piped")),
            last: 0,
            events: Vec::new(),
            _profile: profile,
        };
        browser.ask(None, "Browser.getVersion", &json!({}))?;
        Some(browser)
    }

    /// The result of a command. `None` where the browser has ended.
    fn ask(&mut self, session: Option<&str>, method: &str, parameters: &Value) -> Option<Value> {
        self.last += 1;
        let mut message = json!({ "id": self.last, "method": method, "params": *parameters });
        if let Some(session) = session {
            message["sessionId"] = json!(session);
        }
        self.commands
            .write_all(format!("{message}\0").as_bytes())
            .ok()?;
        loop {
            let mut bytes = Vec::new();
            let length = self.answers.read_until(0, &mut bytes).ok()?;
            let message = bytes.get(..length.checked_sub(1)?)?;
            let message: Value = serde_json::from_slice(message).expect("JSON");
            if message["id"] == self.last {
                assert!(message["error"].is_null(), "{method}: {message}");
                return Some(message["result"].clone());
            }
            self.events.push(message);
        }
    }

    /// A page of a context (a browser without cookies of others), in a window of that width.
    fn open(&mut self, context: &str, address: &str, width: u32) -> Page<'_> {
        let at = json!({ "url": "about:blank", "browserContextId": context });
        let page = self.ask(None, "Target.createTarget", &at).expect("a page");
        let page = json!({ "targetId": page["targetId"], "flatten": true });
        let attached = self.ask(None, "Target.attachToTarget", &page);
        let attached = attached.expect("a session");
        self.events.clear();
        let session = attached["sessionId"].as_str().expect("a name").to_owned();
        let target = page["targetId"].as_str().expect("a name").to_owned();
        let mut page = Page {
            browser: self,
            session,
            target,
        };
        for domain in ["Runtime", "Log", "Network", "Page"] {
            page.ask(&format!("{domain}.enable"), &json!({}));
        }
        page.resize(width);
        page.ask("Page.navigate", &json!({ "url": address }));
        page
    }

    fn context(&mut self) -> String {
        let made = self.ask(None, "Target.createBrowserContext", &json!({}));
        let made = made.expect("a context");
        made["browserContextId"]
            .as_str()
            .expect("a name")
            .to_owned()
    }
}

/// A page.
struct Page<'a> {
    browser: &'a mut Browser,
    session: String,
    target: String,
}

impl Page<'_> {
    fn ask(&mut self, method: &str, parameters: &Value) -> Value {
        let answer = self.browser.ask(Some(&self.session), method, parameters);
        answer.unwrap_or_else(|| panic!("{method}: the browser has ended"))
    }

    fn resize(&mut self, width: u32) {
        let size = json!({
            "width": width, "height": 800, "deviceScaleFactor": 1, "mobile": width < 500,
        });
        self.ask("Emulation.setDeviceMetricsOverride", &size);
    }

    /// Value of an expression in the page.
    fn value(&mut self, expression: &str) -> Value {
        let asked =
            json!({ "expression": expression, "returnByValue": true, "awaitPromise": true });
        let answer = self.ask("Runtime.evaluate", &asked);
        assert!(
            answer["exceptionDetails"].is_null(),
            "{expression}: {answer}"
        );
        answer["result"]["value"].clone()
    }

    fn text(&mut self, id: &str) -> String {
        let text = self.value(&format!("document.getElementById('{id}').textContent"));
        text.as_str().expect("text").to_owned()
    }

    fn number(&mut self, expression: &str) -> f64 {
        let value = self.value(expression);
        value
            .as_f64()
            .unwrap_or_else(|| panic!("{expression}: {value}"))
    }

    /// Waits until an expression is true.
    fn wait(&mut self, expression: &str) {
        while self.value(&format!("Boolean({expression})")) != true {
            std::thread::sleep(Duration::from_millis(20));
        }
    }

    /// Waits until the text of an element holds another.
    fn wait_for(&mut self, id: &str, text: &str) {
        self.wait(&format!(
            "document.getElementById('{id}')?.textContent.includes('{text}')"
        ));
    }

    fn mouse(&mut self, kind: &str, at: [f64; 2], buttons: u32) {
        let pressed = kind != "mouseMoved";
        self.ask(
            "Input.dispatchMouseEvent",
            &json!({
                "type": kind, "x": at[0], "y": at[1], "buttons": buttons,
                "button": if pressed { "left" } else { "none" }, "clickCount": u32::from(pressed),
            }),
        );
    }

    fn click_at(&mut self, at: [f64; 2]) {
        self.mouse("mouseMoved", at, 0);
        self.mouse("mousePressed", at, 1);
        self.mouse("mouseReleased", at, 0);
    }

    /// Middle of an element, which is scrolled into the window.
    fn middle(&mut self, id: &str) -> [f64; 2] {
        let found = self.value(&format!(
            "(() => {{ const e = document.getElementById('{id}'); e.scrollIntoView({{ block: 'nearest' }}); \
             const b = e.getBoundingClientRect(); return [b.x + b.width / 2, b.y + b.height / 2]; }})()"
        ));
        [0, 1].map(|i| found[i].as_f64().expect("a number"))
    }

    fn click(&mut self, id: &str) {
        let at = self.middle(id);
        self.click_at(at);
    }

    /// A key, by its name and the code that Windows gives it.
    fn key(&mut self, key: &str, code: u32) {
        let text = if key.chars().count() == 1 { key } else { "" };
        for kind in ["keyDown", "keyUp"] {
            let mut event = json!({ "type": kind, "key": key, "windowsVirtualKeyCode": code });
            if kind == "keyDown" && !text.is_empty() {
                event["text"] = json!(text);
            }
            self.ask("Input.dispatchKeyEvent", &event);
        }
    }

    fn focus(&mut self, id: &str) {
        self.value(&format!("document.getElementById('{id}').focus()"));
    }

    /// Colors of the canvas, summed up.
    fn canvas(&mut self) -> f64 {
        self.number(
            "(() => { const c = document.getElementById('picture'); let sum = 0; \
             c.getContext('2d').getImageData(0, 0, c.width, c.height).data.forEach((v, i) => sum += v * (i % 251)); \
             return sum; })()",
        )
    }

    /// Versions and passes as the server tells them.
    fn passes(&mut self) -> [f64; 2] {
        let state = "fetch('state').then((r) => r.json()).then((s) => [s.stage.version, s.passes])";
        let found = self.value(state);
        [0, 1].map(|i| found[i].as_f64().expect("a number"))
    }

    /// Neither an error in the console nor a request elsewhere, since the page was opened.
    fn assert_quiet(&mut self, host: &str) {
        // what has been told by now
        self.value("0");
        let mut requests = 0;
        for event in &self.browser.events {
            let parameters = &event["params"];
            match event["method"].as_str() {
                Some("Runtime.exceptionThrown") => panic!("{event}"),
                Some("Runtime.consoleAPICalled") => panic!("{event}"),
                Some("Log.entryAdded") if parameters["entry"]["level"] == "error" => {
                    panic!("{event}")
                }
                Some("Network.requestWillBeSent") => {
                    let url = parameters["request"]["url"].as_str().expect("an address");
                    assert!(url.starts_with(&format!("http://{host}/")), "{url}");
                    requests += 1;
                }
                _ => {}
            }
        }
        assert!(requests > 5, "{requests}");
    }

    fn screenshot(&mut self, name: &str) {
        let Some(place) = std::env::var_os("ABBE_SCREENSHOTS") else {
            return;
        };
        let taken = self.ask("Page.captureScreenshot", &json!({ "format": "png" }));
        let place = std::path::Path::new(&place).join(format!("{name}.png.base64"));
        let text = taken["data"].as_str().expect("base64");
        std::fs::write(place, text).expect("writes");
    }

    fn close(self) {
        let target = json!({ "targetId": self.target });
        self.browser.ask(None, "Target.closeTarget", &target);
    }
}

/// Elements that stand out to the right.
const WIDE: &str = "document.documentElement.scrollWidth > innerWidth";

#[test]
fn the_page_does_what_clicks_and_keys_say() {
    let Some(mut browser) = Browser::start() else {
        return;
    };
    let dir = folder();
    // names are text, whatever they hold
    let path = dir.path().join("<i>.toml");
    std::fs::copy(dir.path().join("scene.toml"), &path).expect("copies");
    let text = std::fs::read_to_string(&path).expect("reads");
    succeed(dir.path(), "render <i>.toml -q --spp 5 -o a.exr");
    let server = Server::start(dir.path(), "<i>.toml --spp 6 --aov depth --against a.exr");
    let (host, address) = (server.host.clone(), server.address());
    let context = browser.context();
    let mut page = browser.open(&context, &address, 1200);
    page.wait_for("status", "6 of 6 passes");
    page.wait("document.getElementById('zoom').textContent !== ''");
    assert_eq!(page.value("location.hash"), "");
    assert_eq!(page.text("name"), "<i>.toml: camera");
    assert_eq!(page.value("document.querySelector('h1 i')"), Value::Null);
    assert_eq!(page.value(WIDE), false);

    // keys zoom, and fit again
    let fitted = page.text("zoom");
    page.key("1", 49);
    assert_eq!(page.text("zoom"), "100 %");
    page.key("+", 187);
    assert_eq!(page.text("zoom"), "125 %");
    page.key("f", 70);
    assert_eq!(page.text("zoom"), fitted);

    // a drag moves the picture by as much
    let middle = page.middle("picture");
    page.mouse("mouseMoved", middle, 0);
    page.wait("document.getElementById('at').textContent.includes(',')");
    let pixel = |page: &mut Page| -> Vec<f64> {
        let at = page.text("at").replace(" (held)", "");
        at.split(", ")
            .map(|n| n.parse().expect("a number"))
            .collect()
    };
    let (before, picture) = (pixel(&mut page), page.canvas());
    let scale: f64 = fitted.trim_end_matches(" %").parse().expect("a number");
    let step = 3.0 * scale / 100.0;
    page.mouse("mousePressed", middle, 1);
    page.mouse("mouseMoved", [middle[0] + step, middle[1]], 1);
    page.mouse("mouseReleased", [middle[0] + step, middle[1]], 0);
    assert_ne!(page.canvas(), picture);
    page.mouse("mouseMoved", [middle[0], middle[1] + 1.0], 0);
    let found = format!("'{}, {}'", before[0] - 3.0, before[1]);
    page.wait(&format!(
        "document.getElementById('at').textContent === {found}"
    ));
    page.click("fit");
    page.mouse("mouseMoved", middle, 0);
    let found = format!("'{}, {}'", before[0], before[1]);
    page.wait(&format!(
        "document.getElementById('at').textContent === {found}"
    ));

    // a click holds the pixel, arrow keys move it; it has a spectrum
    page.click_at(middle);
    page.wait_for("at", "(held)");
    page.key("ArrowRight", 39);
    let right = format!("'{}, {} (held)'", before[0] + 1.0, before[1]);
    page.wait(&format!(
        "document.getElementById('at').textContent === {right}"
    ));
    assert!(page.text("luminance").ends_with(" cd/m²"));
    page.wait_for("spectrum-note", "per nm");

    // exposure by a key: the picture is another one
    let (stops, picture) = (page.text("stops"), page.canvas());
    page.focus("exposure");
    page.key("ArrowRight", 39);
    page.wait(&format!(
        "document.getElementById('stops').textContent !== '{stops}'"
    ));
    assert_eq!(page.value("document.getElementById('auto').checked"), false);
    page.wait("document.getElementById('save-png').href.includes('exposure=')");
    assert_ne!(page.canvas(), picture);
    page.click("auto");
    page.wait(&format!(
        "document.getElementById('stops').textContent === '{stops}'"
    ));

    // the reference stands left of a line that moves
    assert_eq!(page.text("tag-left"), "reference");
    let edge = "document.getElementById('split').offsetLeft";
    let before = page.number(edge);
    page.focus("divide");
    page.key("ArrowLeft", 37);
    page.wait(&format!("{edge} < {before}"));
    page.click("snap");
    page.wait_for("snapshot", "6 passes");
    page.wait_for("tag-left", "snapshot");

    // a layer that the command line asks for, and those that the page asks for
    let layers = "[...document.getElementById('layer').options].map((o) => o.value)";
    assert_eq!(page.value(layers), json!(["", "error", "depth"]));
    let picture = page.canvas();
    page.focus("layer");
    page.key("ArrowDown", 40);
    page.key("ArrowDown", 40);
    assert_eq!(
        page.value("document.getElementById('layer').value"),
        "depth"
    );
    while page.canvas() == picture {
        std::thread::sleep(Duration::from_millis(20));
    }
    page.click("strategies");
    page.wait(&format!("{layers}.includes('s1t2')"));
    page.wait_for("status", "6 of 6 passes");
    assert_eq!(
        page.value("document.getElementById('layer').value"),
        "depth"
    );
    page.screenshot("wide");

    // a file that changes is read again; what is wrong with it is told
    let [version, _] = page.passes();
    std::fs::write(&path, text.replace("radius = 0.6", "radius = -1")).expect("writes");
    page.wait("!document.getElementById('problem').hidden");
    assert!(page.text("problem").contains("<i>.toml:"));
    std::fs::write(&path, text.replace("radius = 0.6", "radius = 0.4")).expect("writes");
    page.wait(&format!(
        "fetch('state').then((r) => r.json()).then((s) => s.stage.version > {version} && s.phase === 'done')"
    ));
    page.wait("document.getElementById('problem').hidden");
    assert_eq!(
        page.value("document.getElementById('detector').hidden"),
        true
    );
    // a phone has no less
    page.resize(390);
    page.wait("innerWidth === 390");
    assert_eq!(page.value(WIDE), false);
    page.screenshot("phone");
    page.assert_quiet(&host);
    page.close();
}

#[test]
fn a_detector_has_its_flux_and_cross_sections() {
    let Some(mut browser) = Browser::start() else {
        return;
    };
    let dir = folder();
    let path = dir.path().join("scene.toml");
    let text = std::fs::read_to_string(&path).expect("reads");
    let plate = "[[sensor]]\nname = \"plate\"\nresolution = [40, 20]\n\
                 detector = { center = [0, 0, 2], u = [-0.5, 0, 0], v = [0, 0.25, 0] }\n";
    std::fs::write(&path, text + plate).expect("writes");
    let server = Server::start(dir.path(), "scene.toml --spp 16 --sensor plate");
    let (host, address) = (server.host.clone(), server.address());
    let context = browser.context();
    let mut page = browser.open(&context, &address, 1200);
    page.wait_for("status", "16 of 16 passes");
    page.wait_for("flux", " \u{b1} ");
    assert!(page.text("flux").ends_with(" lm"));
    assert_eq!(page.text("quantity"), "illuminance");
    assert!(page.text("bar").ends_with(" mm"));
    let middle = page.middle("picture");
    page.click_at(middle);
    page.wait_for("luminance", " lx");
    // both curves are there, each in its color
    page.wait(
        "(() => { const c = document.getElementById('sections'); \
         const d = c.getContext('2d').getImageData(0, 0, c.width, c.height).data; \
         const has = (more, less) => d.some((v, i) => i % 4 === 0 && d[i + 3] > 200 && d[i + more] > d[i + less] + 60); \
         return has(0, 2) && has(2, 0); })()",
    );
    page.screenshot("detector");
    page.assert_quiet(&host);
    page.close();
}

#[test]
fn a_page_that_is_closed_loses_nothing() {
    let Some(mut browser) = Browser::start() else {
        return;
    };
    let dir = folder();
    let server = Server::start(dir.path(), "scene.toml --spp 4000000");
    let (host, address) = (server.host.clone(), server.address());
    let context = browser.context();
    let mut page = browser.open(&context, &address, 1200);
    page.wait_for("status", " of 4000000 passes");
    let [version, passes] = page.passes();
    page.close();
    // the same address opens it again, in another browser, too
    let other = browser.context();
    for context in [&context, &other] {
        let mut page = browser.open(context, &address, 390);
        page.wait_for("status", " of 4000000 passes");
        let [version_now, passes_now] = page.passes();
        assert_eq!(version_now, version);
        assert!(passes_now >= passes, "{passes_now} {passes}");
        page.assert_quiet(&host);
        page.close();
    }
    // with another token there is an empty page
    let stranger = browser.context();
    let mut page = browser.open(
        &stranger,
        &format!("http://{host}/#{}", "0".repeat(32)),
        1200,
    );
    page.wait_for("status", "locked: ");
    assert_eq!(page.text("name"), "abbe");
    page.close();
}
