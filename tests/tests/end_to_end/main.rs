//! The programs as a person runs them: one test binary, one module a subject.
#![forbid(unsafe_code)]

mod office;
mod run_refusals;
