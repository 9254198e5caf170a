//! The pages' templates, part of the program so that it stays one file.

use std::path::Path;

use minijinja::syntax::SyntaxConfig;
use minijinja::value::Serde;
use minijinja::{AutoEscape, Environment, Value};
use serde::Serialize;

use super::{Error, format, write_whole};

#[derive(Clone, Copy, Debug)]
pub enum Template {
    Evaluation,
    Report,
    SetupSheet,
    ScreenMap,
}

impl Template {
    fn source(self) -> (&'static str, &'static str) {
        match self {
            Template::Evaluation => ("evaluation.html", include_str!("templates/evaluation.html")),
            Template::Report => ("report.html", include_str!("templates/report.html")),
            Template::SetupSheet => ("setup-sheet.html", include_str!("templates/setup-sheet.html")),
            Template::ScreenMap => ("screen-map.svg", include_str!("templates/screen-map.svg")),
        }
    }
}

/// Fills a template and writes the page, whole or not at all.
pub fn write(path: &Path, template: Template, filled: &impl Serialize) -> Result<(), Error> {
    let page = fill(template, Value::from(Serde(filled)))?;
    write_whole(path, |writer| {
        writer
            .write_all(page.as_bytes())
            .map_err(|source| Error::Io { path: path.display().to_string(), source })
    })
}

fn fill(template: Template, context: Value) -> Result<String, Error> {
    let (name, source) = template.source();
    let mut pages = Environment::new();
    pages.set_auto_escape_callback(|_| AutoEscape::Html);
    let syntax = SyntaxConfig::builder().trim_blocks(true).lstrip_blocks(true).build();
    pages.set_syntax(syntax.expect("the usual delimiters differ"));
    pages.add_filter("micrometres", shown(format::micrometres));
    pages.add_filter("percent", shown(format::percent));
    pages.add_filter("degrees", shown(format::degrees));
    pages.add_filter("duration", shown(format::duration));
    pages.add_filter("fixed", |value: Option<f64>, decimals: usize| {
        value.map_or(NONE.to_string(), |value| format::fixed(value, decimals))
    });
    pages
        .render_named_str(name, source, context)
        .map_err(|source| Error::Page { page: name, source: Box::new(source) })
}

/// What was not measured.
const NONE: &str = "\u{2013}";

fn shown(show: fn(f64) -> String) -> impl Fn(Option<f64>) -> String {
    move |value| value.map_or(NONE.to_string(), show)
}
