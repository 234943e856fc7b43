//! Answers of the server, by request.

use super::guard::Guard;
use super::http::{Method, Request, Response};
use super::picture;
use super::studio::Studio;
use serde_json::Value;

const PAGE: &str = include_str!("page/index.html");
const SCRIPT: &str = include_str!("page/view.js");
const PLOT: &str = include_str!("page/plot.js");
const STYLE: &str = include_str!("page/view.css");

/// The answer to a request. Without the cookie there is the page alone, which holds nothing.
pub fn answer(request: &Request, guard: &Guard, studio: &Studio) -> Response {
    if let Err(refusal) = guard.check(request) {
        return refusal;
    }
    match (request.method, request.path.as_str()) {
        (Method::Get, "/") => return Response::of("text/html; charset=utf-8", PAGE),
        (Method::Get, "/view.js") => return Response::of("text/javascript; charset=utf-8", SCRIPT),
        (Method::Get, "/plot.js") => return Response::of("text/javascript; charset=utf-8", PLOT),
        (Method::Get, "/view.css") => return Response::of("text/css; charset=utf-8", STYLE),
        // browsers ask on their own
        (Method::Get, "/favicon.ico") => return Response::nothing_yet(),
        (Method::Post, "/session") => return guard.exchange(&request.body),
        _ => {}
    }
    if !guard.knows(request) {
        return Response::refusal(401, "open the address that was printed");
    }
    let answered = match (request.method, request.path.as_str()) {
        (Method::Get, "/state") => Ok(json(&studio.state())),
        (Method::Get, "/picture.png") => picture::show(request, studio),
        (Method::Get, "/pixel") => pixel(request, studio),
        (Method::Get, "/save.png") => picture::save_png(request, studio),
        (Method::Get, "/save.exr") => picture::save_exr(studio),
        (Method::Post, "/settings") => {
            let set = studio.set(&request.body);
            set.map(|()| done()).map_err(|e| Response::refusal(400, &e))
        }
        (Method::Post, "/snapshot") => {
            let taken = studio.take_snapshot().map(|()| done());
            taken.ok_or_else(|| Response::refusal(409, "there is no picture yet"))
        }
        _ => Err(Response::refusal(404, "there is nothing here")),
    };
    answered.unwrap_or_else(|refusal| refusal)
}

fn json(value: &Value) -> Response {
    Response::of("application/json", value.to_string())
}

fn done() -> Response {
    Response::of("text/plain; charset=utf-8", "done\n")
}

fn pixel(request: &Request, studio: &Studio) -> Result<Response, Response> {
    let number = |name: &str| request.query.get(name)?.parse().ok();
    let pixel = number("x").zip(number("y"));
    let (x, y) = pixel.ok_or_else(|| Response::refusal(400, "expected x and y"))?;
    let found = studio.stage().and_then(|stage| stage.pixel(x, y));
    let found = found.ok_or_else(Response::nothing_yet)?;
    Ok(json(&found))
}
