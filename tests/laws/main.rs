//! What holds for all tests: none ends early and says ok, each comes to an assertion, and none but the trials of
//! `tests/real` knows of anything outside of the checkout.
//!
//! Sources are taken as tokens: what stands in comments is none of it.

mod circles;
mod rooms;

use std::collections::HashSet;
use std::fs;
use std::path::Path;

use proc_macro2::{Delimiter, Group, TokenStream, TokenTree};

/// The one file that knows where real data are.
const KIT: &str = "tests/real/kit.rs";

/// How a path leaves a folder. In two parts, or this would be one.
const UP: &str = concat!("..", "/");

/// A function in test code.
#[derive(Debug)]
struct Function {
    name: String,
    line: usize,
    is_test: bool,
    /// Every name in its body: what it calls is among them.
    names: HashSet<String>,
}

/// A source file, as far as it is test code.
#[derive(Debug, Default)]
struct Source {
    file: String,
    functions: Vec<Function>,
    faults: Vec<String>,
}

impl Source {
    /// All of a file that is nothing but tests, or else its modules that are.
    fn new(file: &str, text: &str, is_tests: bool) -> Self {
        let mut source = Self { file: file.to_owned(), ..Self::default() };
        let tokens: TokenStream = text.parse().unwrap_or_else(|error| panic!("{file}: {error}"));
        let tokens = trees(tokens);
        if is_tests {
            source.read(&tokens);
        }
        for (at, token) in tokens.iter().enumerate().filter(|_| !is_tests) {
            // [cfg(test)] mod name { … }
            if token.to_string().replace(' ', "") == "[cfg(test)]" {
                tokens[at..].iter().skip(1).take(3).filter_map(braces).for_each(|body| source.read(&body));
            }
        }
        source
    }

    fn fault(&mut self, token: &TokenTree, what: &str) {
        self.faults.push(format!("{}:{}: {what}", self.file, token.span().start().line));
    }

    fn read(&mut self, tokens: &[TokenTree]) {
        for (at, token) in tokens.iter().enumerate() {
            let next = |n: usize| tokens.get(at + n);
            match token {
                TokenTree::Group(group) if !says_or_leads(group) => self.read(&trees(group.stream())),
                TokenTree::Literal(literal) if self.file != KIT && literal.to_string().contains(UP) => {
                    self.fault(token, "only the kit of the real trials looks outside of the checkout");
                }
                TokenTree::Ident(name) if name == "env" && self.file != KIT => {
                    let path: String = tokens[at..].iter().take(4).map(ToString::to_string).collect();
                    if path.starts_with("env::var") {
                        self.fault(token, "a test is the same in every environment");
                    }
                }
                TokenTree::Ident(name) if name == "return" => {
                    let is_ok = next(1).is_some_and(|t| is(t, "Ok"))
                        && next(2).is_some_and(|t| t.to_string().replace(' ', "") == "(())");
                    if ends(next(1)) || is_ok && ends(next(3)) {
                        self.fault(token, "what returns early says ok, whatever it has seen");
                    }
                }
                TokenTree::Ident(name) if name == "fn" => self.functions.extend(function(tokens, at)),
                _ => {}
            }
        }
    }
}

/// `fn name … { body }`, with its attributes before it.
fn function(tokens: &[TokenTree], at: usize) -> Option<Function> {
    let TokenTree::Ident(name) = tokens.get(at + 1)? else { return None };
    let body = tokens[at..].iter().find(|token| is(token, ";") || braces(token).is_some())?;
    let mut names = HashSet::new();
    collect_names(&braces(body)?, &mut names);
    let before = tokens[..at].iter().rev().take_while(|token| !is(token, ";") && braces(token).is_none());
    let attributes: Vec<String> = before.map(ToString::to_string).collect();
    if attributes.iter().any(|attribute| attribute.starts_with("[should_panic")) {
        names.insert("panic".to_owned());
    }
    let is_test = attributes.iter().any(|attribute| attribute == "[test]");
    Some(Function { name: name.to_string(), line: name.span().start().line, is_test, names })
}

fn collect_names(tokens: &[TokenTree], names: &mut HashSet<String>) {
    for token in tokens {
        match token {
            TokenTree::Group(group) => collect_names(&trees(group.stream()), names),
            TokenTree::Ident(name) => _ = names.insert(name.to_string()),
            _ => {}
        }
    }
}

/// Documentation, and the paths of modules.
fn says_or_leads(group: &Group) -> bool {
    let first = trees(group.stream()).into_iter().next();
    group.delimiter() == Delimiter::Bracket
        && first.is_some_and(|first| is(&first, "doc") || is(&first, "path"))
}

fn trees(stream: TokenStream) -> Vec<TokenTree> {
    stream.into_iter().collect()
}

fn is(token: &TokenTree, text: &str) -> bool {
    !matches!(token, TokenTree::Literal(_)) && token.to_string() == text
}

/// Whether an expression ends before this token.
fn ends(token: Option<&TokenTree>) -> bool {
    token.is_none_or(|token| is(token, ";") || is(token, ","))
}

fn braces(token: &TokenTree) -> Option<Vec<TokenTree>> {
    match token {
        TokenTree::Group(group) if group.delimiter() == Delimiter::Brace => Some(trees(group.stream())),
        _ => None,
    }
}

/// Whether something of this name fails a test, by itself or as a checker of threads. A test may also be that nothing
/// panics: its name says so.
fn asserts(name: &str) -> bool {
    let starts = ["assert", "debug_assert", "prop_assert", "panic", "unreachable", "unwrap_err", "shuttle"];
    starts.iter().any(|start| name.starts_with(start))
}

/// Whether tests in one file may call what is in another: from the same folder, or made for all.
fn is_near(source: &Source, other: &Source) -> bool {
    let folder = |source: &Source| source.file.rsplit_once('/').map(|(folder, _)| folder.to_owned());
    let is_kit =
        ["tests/checks/", "tests/common/", "examples/"].iter().any(|kit| other.file.starts_with(kit));
    folder(source) == folder(other) || source.file.starts_with("tests/") && is_kit
}

/// Faults of all sources; a test that comes to no assertion, be it in what it calls, is one.
fn faults(sources: &[Source]) -> Vec<String> {
    let mut asserting: HashSet<(usize, &str)> = HashSet::new();
    let is_asserting = |asserting: &HashSet<(usize, &str)>, file: usize, name: &str| {
        let is_own = sources[file].functions.iter().any(|f| f.name == name);
        let may_call = |other: &usize| *other == file || !is_own && is_near(&sources[file], &sources[*other]);
        asserts(name)
            || (0..sources.len()).any(|other| asserting.contains(&(other, name)) && may_call(&other))
    };
    loop {
        let before = asserting.len();
        for (file, source) in sources.iter().enumerate() {
            for function in &source.functions {
                let own = (file, function.name.as_str());
                if !asserting.contains(&own)
                    && function.names.iter().any(|name| is_asserting(&asserting, file, name))
                {
                    asserting.insert(own);
                }
            }
        }
        if asserting.len() == before {
            break;
        }
    }
    let mut faults: Vec<String> = sources.iter().flat_map(|source| source.faults.clone()).collect();
    for (file, source) in sources.iter().enumerate() {
        for test in source.functions.iter().filter(|f| f.is_test && !f.name.contains("panics")) {
            if !asserting.contains(&(file, &test.name)) {
                faults.push(format!("{}:{}: {} asserts nothing", source.file, test.line, test.name));
            }
        }
    }
    faults
}

/// All sources below a folder of the checkout.
fn collect(folder: &str, is_tests: bool, sources: &mut Vec<Source>) {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut entries: Vec<_> = fs::read_dir(root.join(folder)).unwrap().map(|entry| entry.unwrap()).collect();
    entries.sort_by_key(fs::DirEntry::file_name);
    for entry in entries {
        let name = format!("{folder}/{}", entry.file_name().to_str().unwrap());
        if entry.file_type().unwrap().is_dir() {
            collect(&name, is_tests, sources);
        } else if name.ends_with(".rs") {
            let is_tests = is_tests || name.ends_with("/tests.rs");
            sources.push(Source::new(&name, &fs::read_to_string(entry.path()).unwrap(), is_tests));
        }
    }
}

#[test]
fn tests_keep_the_laws() {
    let mut sources = Vec::new();
    collect("src", false, &mut sources);
    collect("tests", true, &mut sources);
    collect("examples", true, &mut sources);
    for backend in fs::read_dir(Path::new(env!("CARGO_MANIFEST_DIR")).join("backends")).unwrap() {
        let backend = backend.unwrap();
        for (folder, is_tests) in [("src", false), ("tests", true)] {
            if backend.path().join(folder).is_dir() {
                let folder = format!("backends/{}/{folder}", backend.file_name().to_str().unwrap());
                collect(&folder, is_tests, &mut sources);
            }
        }
    }
    let tests = sources.iter().flat_map(|source| &source.functions).filter(|f| f.is_test).count();
    assert!(
        sources.len() > 200 && tests > 300,
        "{tests} tests in {} files: where are the others?",
        sources.len()
    );
    let faults = faults(&sources);
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

/// The law itself can fail, and lets pass what is right.
#[test]
fn laws_are_laws() {
    let found = |file: &str, text: &str| faults(&[Source::new(file, &text.replace("UP", ".."), true)]);
    let wrong = [
        ("#[test] fn a() { let Some(x) = f() else { return }; assert!(x) }", "early"),
        ("#[test] fn a() { assert!(x); if y { return; } }", "early"),
        ("fn helper() { match x { None => return, Some(x) => assert!(x) } }", "early"),
        ("#[test] fn a() -> Result<(), E> { if x { return Ok(()); } assert!(y); Ok(()) }", "early"),
        ("proptest! { #[test] fn a(x in y) { if x { return Ok(()) } prop_assert!(x) } }", "early"),
        ("const F: &str = concat!(env!(\"CARGO_MANIFEST_DIR\"), \"/UP/shared/data\");", "outside"),
        ("#[test] fn a() { assert!(read(r\"UP/data\")) }", "outside"),
        ("#[test] fn a() { assert!(std::env::var(\"X\").is_ok()) }", "environment"),
        ("#[test] fn a() { assert!(env::var_os(\"X\").is_some()) }", "environment"),
        ("#[test] fn a() { let _ = f(); }", "nothing"),
        ("fn f() { g() } fn g() {} #[test] fn a() { f() }", "nothing"),
    ];
    for (text, what) in wrong {
        let faults = found("tests/a.rs", text);
        assert!(faults.len() == 1 && faults[0].contains(what), "{text}: {faults:?}");
    }
    let right = [
        "#[test] fn a() { f() } fn f() { g() } fn g() { assert!(x) }",
        "fn f() -> u8 { if x { return 1; } 2 }",
        "#[test] #[should_panic] fn a() { f() }",
        "proptest! { #[test] fn no_text_panics(x in y) { let _ = f(x); } }",
        "#[path = \"UP/common/mod.rs\"] mod common; /// In `UP/data`, return;\n fn f() {}",
    ];
    for text in right {
        assert_eq!(found("tests/a.rs", text), <[String; 0]>::default(), "{text}");
    }
    let kit = "fn folder() { env::var_os(\"UP/shared\") }";
    assert_eq!((found(KIT, kit).len(), found("tests/real/main.rs", kit).len()), (0, 2));
    // Of a source that is more than tests, these.
    let mixed = "fn f() { return; } #[cfg(test)] mod tests { #[test] fn a() { return; } }".to_owned();
    assert_eq!(faults(&[Source::new("src/a.rs", &mixed, false)]).len(), 2);
}
