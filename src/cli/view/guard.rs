//! The lock of the server's door: who may ask for anything but the empty page.
//!
//! The address that is printed ends in a random token of 128 bits, in the fragment, which browsers
//! send nowhere and write into no log. The page hands it over once, for a cookie that no script can
//! read and that no other site can have sent along. Every request must name this server as its host
//! (other names may lead here, too) and come from no other page.

use super::http::{Method, Request, Response};
use std::fmt::Write as _;
use std::io;

/// The lock.
#[derive(Debug)]
pub struct Guard {
    /// Host and port, as the browser names them.
    host: String,
    token: String,
    /// Name and value of the cookie.
    cookie: (String, String),
}

/// 128 random bits in hexadecimal.
fn secret() -> io::Result<String> {
    let mut bytes = [0; 16];
    getrandom::fill(&mut bytes).map_err(|e| io::Error::other(e.to_string()))?;
    let mut text = String::new();
    for byte in bytes {
        _ = write!(text, "{byte:02x}");
    }
    Ok(text)
}

/// Whether two secrets are the same, in a time that does not tell how far they agree.
fn is_same(a: &[u8], b: &[u8]) -> bool {
    let differences = a.iter().zip(b).fold(0, |all, (a, b)| all | (a ^ b));
    a.len() == b.len() && differences == 0
}

impl Guard {
    /// A lock of the server on that port, with secrets of its own.
    ///
    /// # Errors
    /// The system has no random numbers.
    pub fn new(port: u16) -> io::Result<Self> {
        Ok(Self {
            host: format!("127.0.0.1:{port}"),
            token: secret()?,
            // cookies are shared by all ports of a host
            cookie: (format!("abbe{port}"), secret()?),
        })
    }

    /// The address to open.
    pub fn address(&self) -> String {
        format!("http://{}/#{}", self.host, self.token)
    }

    /// Refuses requests to another host and those of other pages.
    pub fn check(&self, request: &Request) -> Result<(), Response> {
        let refuse = |what| Err(Response::refusal(403, what));
        if request.header("host") != Some(&self.host) {
            return refuse("this is another host");
        }
        let own = format!("http://{}", self.host);
        let origin = request.header("origin") == Some(&own);
        // browsers leave it out for GET
        let may_lack = request.method == Method::Get && !request.has_header("origin");
        if !origin && !may_lack {
            return refuse("the request comes from another page");
        }
        let site = request.header("sec-fetch-site");
        let from_here = matches!(site, Some("same-origin" | "none"));
        if request.has_header("sec-fetch-site") && !from_here {
            return refuse("the request comes from another site");
        }
        Ok(())
    }

    /// Whether the request has the cookie.
    pub fn knows(&self, request: &Request) -> bool {
        let cookies = request.header("cookie").unwrap_or_default().split(';');
        let mut values = cookies.filter_map(|c| c.trim().split_once('='));
        let (name, value) = &self.cookie;
        values.any(|(n, v)| n == name && is_same(v.as_bytes(), value.as_bytes()))
    }

    /// The cookie for the token.
    pub fn exchange(&self, token: &[u8]) -> Response {
        if !is_same(token, self.token.as_bytes()) {
            return Response::refusal(401, "wrong token: open the address that was printed");
        }
        let (name, value) = &self.cookie;
        let cookie = format!("{name}={value}; Path=/; HttpOnly; SameSite=Strict");
        let mut response = Response::of("text/plain; charset=utf-8", "welcome\n");
        response.headers.push(("Set-Cookie", cookie));
        response
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn secrets_are_long_and_new() {
        let (a, b) = (secret().expect("random"), secret().expect("random"));
        assert_eq!((a.len(), b.len()), (32, 32));
        assert_ne!(a, b);
        assert!(is_same(a.as_bytes(), a.as_bytes()));
        assert!(!is_same(a.as_bytes(), b.as_bytes()));
        assert!(!is_same(a.as_bytes(), &a.as_bytes()[..31]));
        assert!(!is_same(a.as_bytes(), b""));
    }
}
