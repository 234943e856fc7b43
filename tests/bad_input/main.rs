//! Bad input: every wrong file gets an error that names the place, and no bytes make a reader
//! panic.

mod binary;
mod images;
mod keys;
mod models;
mod mutation;
mod scene;
mod tables;
