//! A small HTTP server for one browser on the same machine: one request per connection, with limits
//! on sizes, connections and times. Messages are parsed by httparse.

use std::collections::BTreeMap;
use std::io::{self, Read, Write};
use std::net::{Shutdown, TcpListener, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering::SeqCst};
use std::time::{Duration, Instant};

/// Largest head of a request, and most of its headers.
const MAX_HEAD: usize = 8 << 10;
const MAX_HEADERS: usize = 48;
/// Largest body of a request.
const MAX_BODY: usize = 4 << 10;
/// Connections at a time: browsers open six.
const MAX_CONNECTIONS: usize = 16;
/// Time for a request to arrive, and for its answer to be taken.
const READ_TIME: Duration = Duration::from_secs(5);
const WRITE_TIME: Duration = Duration::from_secs(60);
/// Time, and bytes, that a refused request may still take.
const LINGER: Duration = Duration::from_secs(1);
const MAX_IGNORED: usize = 64 << 10;

/// The methods that are answered.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Method {
    Get,
    Post,
}

/// A request.
#[derive(Clone, Debug)]
pub struct Request {
    pub method: Method,
    /// Path without the query.
    pub path: String,
    /// Values of the query by name, percent-decoded.
    pub query: BTreeMap<String, String>,
    /// Values of headers by their name in lower case; of a repeated one all.
    pub headers: BTreeMap<String, Vec<String>>,
    pub body: Vec<u8>,
}

impl Request {
    /// The value of a header that is there once.
    pub fn header(&self, name: &str) -> Option<&str> {
        match self.headers.get(name)?.as_slice() {
            [one] => Some(one),
            _ => None,
        }
    }

    /// Whether a header is there at all.
    pub fn has_header(&self, name: &str) -> bool {
        self.headers.contains_key(name)
    }
}

/// An answer.
#[derive(Clone, Debug)]
pub struct Response {
    pub status: u16,
    /// Media type of the body.
    pub kind: &'static str,
    /// Headers besides those that every answer has.
    pub headers: Vec<(&'static str, String)>,
    pub body: Vec<u8>,
}

impl Response {
    /// An answer with a body.
    pub fn of(kind: &'static str, body: impl Into<Vec<u8>>) -> Self {
        Self {
            status: 200,
            kind,
            headers: Vec::new(),
            body: body.into(),
        }
    }

    /// An answer without a body: what was asked for is not there yet.
    pub fn nothing_yet() -> Self {
        Self {
            status: 204,
            ..Self::of("text/plain; charset=utf-8", "")
        }
    }

    /// A refusal, in words.
    pub fn refusal(status: u16, message: &str) -> Self {
        Self {
            status,
            ..Self::of("text/plain; charset=utf-8", format!("{message}\n"))
        }
    }
}

/// Headers of every answer: no other site may embed, read or learn of the page, nothing of it is
/// kept, and it loads nothing from elsewhere.
const HEADERS: &str = "Connection: close\r\n\
    Cache-Control: no-store\r\n\
    Content-Security-Policy: default-src 'self'; base-uri 'none'; form-action 'none'; \
    frame-ancestors 'none'\r\n\
    Referrer-Policy: no-referrer\r\n\
    X-Content-Type-Options: nosniff\r\n\
    Cross-Origin-Resource-Policy: same-origin\r\n\
    Cross-Origin-Opener-Policy: same-origin\r\n";

fn reason(status: u16) -> &'static str {
    match status {
        200 => "OK",
        204 => "No Content",
        400 => "Bad Request",
        401 => "Unauthorized",
        403 => "Forbidden",
        404 => "Not Found",
        405 => "Method Not Allowed",
        408 => "Request Timeout",
        409 => "Conflict",
        413 => "Content Too Large",
        431 => "Request Header Fields Too Large",
        _ => "Error",
    }
}

/// Counts a connection while it lives.
struct Slot(Arc<AtomicUsize>);

impl Slot {
    fn take(count: &Arc<AtomicUsize>) -> Option<Self> {
        let slot = Self(Arc::clone(count));
        (count.fetch_add(1, SeqCst) < MAX_CONNECTIONS).then_some(slot)
    }
}

impl Drop for Slot {
    fn drop(&mut self) {
        self.0.fetch_sub(1, SeqCst);
    }
}

/// Answers requests for as long as the process lives. Connections beyond the limit are closed.
pub fn serve(
    listener: &TcpListener,
    answer: impl Fn(&Request) -> Response + Send + Sync + 'static,
) {
    let (answer, count) = (Arc::new(answer), Arc::new(AtomicUsize::new(0)));
    for stream in listener.incoming() {
        let Ok(stream) = stream else {
            // out of descriptors for a moment
            std::thread::sleep(Duration::from_millis(50));
            continue;
        };
        if let Some(slot) = Slot::take(&count) {
            let answer = Arc::clone(&answer);
            let work = move || {
                // whoever has gone needs no answer
                _ = converse(&stream, &*answer);
                drop(slot);
            };
            // without a thread the connection is closed
            _ = std::thread::Builder::new().spawn(work);
        }
    }
}

fn converse(stream: &TcpStream, answer: &dyn Fn(&Request) -> Response) -> io::Result<()> {
    let response = match receive(stream) {
        Ok(Ok(request)) => answer(&request),
        Ok(Err(refusal)) => {
            send(stream, &refusal)?;
            return ignore_rest(stream);
        }
        Err(e)
            if matches!(
                e.kind(),
                io::ErrorKind::WouldBlock | io::ErrorKind::TimedOut
            ) =>
        {
            Response::refusal(408, "the request took too long")
        }
        Err(e) => return Err(e),
    };
    send(stream, &response)
}

/// Reads what is left of a request that was refused, for a while: a connection that is closed
/// before is reset, and the refusal lost.
fn ignore_rest(stream: &TcpStream) -> io::Result<()> {
    stream.shutdown(Shutdown::Write)?;
    let (end, mut ignored) = (Instant::now() + LINGER, Vec::new());
    while ignored.len() < MAX_IGNORED && read_more(stream, &mut ignored, end)? {}
    Ok(())
}

/// Reads more bytes until a deadline; `false` at the end of the stream.
fn read_more(mut stream: &TcpStream, bytes: &mut Vec<u8>, end: Instant) -> io::Result<bool> {
    let left = end.saturating_duration_since(Instant::now());
    if left.is_zero() {
        return Err(io::ErrorKind::TimedOut.into());
    }
    stream.set_read_timeout(Some(left))?;
    let mut buffer = [0; 4096];
    let count = stream.read(&mut buffer)?;
    bytes.extend(&buffer[..count]);
    Ok(count > 0)
}

/// A request, or why it is refused.
fn receive(stream: &TcpStream) -> io::Result<Result<Request, Response>> {
    let end = Instant::now() + READ_TIME;
    let mut bytes = Vec::new();
    let (mut request, length, head) = loop {
        if bytes.len() > MAX_HEAD {
            return Ok(Err(Response::refusal(
                431,
                "the head of the request is too large",
            )));
        }
        if !read_more(stream, &mut bytes, end)? {
            return Err(io::ErrorKind::UnexpectedEof.into());
        }
        match parse(&bytes) {
            Ok(None) => {}
            Ok(Some(parsed)) => break parsed,
            Err(refusal) => return Ok(Err(refusal)),
        }
    };
    let mut body = bytes.split_off(head);
    while body.len() < length {
        if !read_more(stream, &mut body, end)? {
            return Err(io::ErrorKind::UnexpectedEof.into());
        }
    }
    body.truncate(length);
    request.body = body;
    Ok(Ok(request))
}

/// A head with the lengths of body and head; `None` where more of it is to come.
fn parse(bytes: &[u8]) -> Result<Option<(Request, usize, usize)>, Response> {
    let bad = || Response::refusal(400, "not a request");
    let mut headers = [httparse::EMPTY_HEADER; MAX_HEADERS];
    let mut parsed = httparse::Request::new(&mut headers);
    let head = match parsed.parse(bytes) {
        Ok(httparse::Status::Complete(head)) if head <= MAX_HEAD => head,
        Ok(httparse::Status::Partial) => return Ok(None),
        Ok(_) | Err(httparse::Error::TooManyHeaders) => {
            return Err(Response::refusal(
                431,
                "the head of the request is too large",
            ));
        }
        Err(_) => return Err(bad()),
    };
    let method = match parsed.method {
        Some("GET") => Method::Get,
        Some("POST") => Method::Post,
        _ => return Err(Response::refusal(405, "only GET and POST are answered")),
    };
    let mut by_name: BTreeMap<String, Vec<String>> = BTreeMap::new();
    for header in parsed.headers.iter() {
        let value = std::str::from_utf8(header.value).map_err(|_| bad())?;
        let values = by_name.entry(header.name.to_ascii_lowercase());
        values.or_default().push(value.to_owned());
    }
    let (path, query) = parsed
        .path
        .filter(|path| path.starts_with('/'))
        .map(|path| path.split_once('?').unwrap_or((path, "")))
        .ok_or_else(bad)?;
    let request = Request {
        method,
        path: path.to_owned(),
        query: values(query).ok_or_else(bad)?,
        headers: by_name,
        body: Vec::new(),
    };
    // bodies in chunks have no length to look at beforehand
    if request.has_header("transfer-encoding") {
        return Err(bad());
    }
    let length = match request.has_header("content-length") {
        false => 0,
        true => {
            let length = request
                .header("content-length")
                .and_then(|v| v.parse().ok());
            length.ok_or_else(bad)?
        }
    };
    if length > MAX_BODY {
        return Err(Response::refusal(
            413,
            "the body of the request is too large",
        ));
    }
    Ok(Some((request, length, head)))
}

/// The values of a query; `None` where one is not understood.
fn values(query: &str) -> Option<BTreeMap<String, String>> {
    let pairs = query.split('&').filter(|pair| !pair.is_empty());
    let decoded = pairs.map(|pair| {
        let (name, value) = pair.split_once('=').unwrap_or((pair, ""));
        Some((percent_decoded(name)?, percent_decoded(value)?))
    });
    decoded.collect()
}

fn percent_decoded(text: &str) -> Option<String> {
    let mut bytes = Vec::with_capacity(text.len());
    let mut rest = text.bytes();
    while let Some(byte) = rest.next() {
        bytes.push(match byte {
            b'%' => {
                let mut digit = || char::from(rest.next()?).to_digit(16);
                (16 * digit()? + digit()?) as u8
            }
            b'+' => b' ',
            other => other,
        });
    }
    String::from_utf8(bytes).ok()
}

fn send(mut stream: &TcpStream, response: &Response) -> io::Result<()> {
    let Response {
        status,
        kind,
        headers,
        body,
    } = response;
    let mut head = format!(
        "HTTP/1.1 {status} {}\r\nContent-Type: {kind}\r\nContent-Length: {}\r\n{HEADERS}",
        reason(*status),
        body.len()
    );
    for (name, value) in headers {
        head += &format!("{name}: {value}\r\n");
    }
    head += "\r\n";
    let end = Instant::now() + WRITE_TIME;
    let mut bytes = head.into_bytes();
    bytes.extend_from_slice(body);
    for chunk in bytes.chunks(1 << 16) {
        let left = end.saturating_duration_since(Instant::now());
        if left.is_zero() {
            return Err(io::ErrorKind::TimedOut.into());
        }
        stream.set_write_timeout(Some(left))?;
        stream.write_all(chunk)?;
    }
    stream.flush()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn request(text: &str) -> Result<Option<(Request, usize, usize)>, u16> {
        parse(text.as_bytes()).map_err(|refusal| refusal.status)
    }

    #[test]
    fn heads_are_parsed_whole_or_not_at_all() {
        let text = "POST /a?x=1%2C2&y=b+c&z HTTP/1.1\r\nHost: h\r\nContent-Length: 3\r\n\r\nabc";
        let (parsed, length, head) = request(text).expect("valid").expect("whole");
        assert_eq!((length, head), (3, text.len() - 3));
        assert_eq!(parsed.path, "/a");
        assert_eq!(parsed.query["x"], "1,2");
        assert_eq!(parsed.query["y"], "b c");
        assert_eq!(parsed.query["z"], "");
        assert_eq!(parsed.header("host"), Some("h"));
        for end in 0..head {
            assert!(
                request(&text[..end]).expect("so far valid").is_none(),
                "{end}"
            );
        }
        // of two nothing is taken for granted
        let (twice, _, _) = request("GET / HTTP/1.1\r\nHost: a\r\nhost: b\r\n\r\n")
            .expect("valid")
            .expect("whole");
        assert!(twice.header("host").is_none() && twice.has_header("host"));
    }

    #[test]
    fn what_is_too_large_or_strange_is_refused() {
        for (text, status) in [
            ("DELETE / HTTP/1.1\r\n\r\n", 405),
            ("GET http://a/ HTTP/1.1\r\n\r\n", 400),
            ("GET /?a=%zz HTTP/1.1\r\n\r\n", 400),
            ("POST / HTTP/1.1\r\nContent-Length: 4097\r\n\r\n", 413),
            ("POST / HTTP/1.1\r\nContent-Length: -1\r\n\r\n", 400),
            (
                "POST / HTTP/1.1\r\nContent-Length: 1\r\nContent-Length: 2\r\n\r\n",
                400,
            ),
            ("POST / HTTP/1.1\r\nTransfer-Encoding: chunked\r\n\r\n", 400),
            ("no request\r\n\r\n", 400),
        ] {
            assert_eq!(request(text).err(), Some(status), "{text}");
        }
        let many = "A: b\r\n".repeat(MAX_HEADERS + 1);
        assert_eq!(
            request(&format!("GET / HTTP/1.1\r\n{many}\r\n")).err(),
            Some(431)
        );
    }
}
