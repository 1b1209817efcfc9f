//! No file imports one that imports it, be it by way of others: then each can be read, tested and thrown away with nothing but
//! what is below it.
//!
//! A file imports another if a path in it, in a `use` or elsewhere, leads into a module of the other: to a name that is there,
//! or is passed on from there (`pub use`). That a module is declared (`mod`) is no import. Other crates do not count: Cargo
//! lets none depend on one that depends on it.

use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::fs;
use std::path::Path;

use proc_macro2::{Delimiter, Spacing, TokenStream, TokenTree};

/// The place of a module in its crate.
type Module = Vec<String>;

/// For each file, the files that it imports, and by what paths.
type Imports = BTreeMap<String, BTreeMap<String, BTreeSet<String>>>;

/// A name brought into a module.
#[derive(Debug)]
struct Use {
    path: Vec<String>,
    name: String,
}

/// The modules of a crate.
#[derive(Debug, Default)]
struct Modules {
    /// The file that each is in.
    files: HashMap<Module, String>,
    uses: HashMap<Module, Vec<Use>>,
    /// Other paths, with the module in which they stand.
    paths: Vec<(Module, Vec<String>)>,
}

/// Tokens without their nesting, `::` in one piece, literals as a quote.
pub(crate) fn flatten(stream: TokenStream, tokens: &mut Vec<String>) {
    let mut is_half = false;
    for tree in stream {
        let was_half = std::mem::take(&mut is_half);
        match tree {
            TokenTree::Group(group) => {
                let (open, close) = match group.delimiter() {
                    Delimiter::Brace => ("{", "}"),
                    Delimiter::Bracket => ("[", "]"),
                    Delimiter::Parenthesis => ("(", ")"),
                    Delimiter::None => ("", ""),
                };
                tokens.push(open.to_owned());
                flatten(group.stream(), tokens);
                tokens.push(close.to_owned());
            }
            TokenTree::Literal(_) => tokens.push("\"".to_owned()),
            TokenTree::Ident(name) => tokens.push(name.to_string()),
            TokenTree::Punct(punct) if punct.as_char() == ':' => {
                match tokens.last_mut().filter(|_| was_half) {
                    Some(last) => last.push(':'),
                    None => tokens.push(":".to_owned()),
                }
                is_half = !was_half && punct.spacing() == Spacing::Joint;
            }
            TokenTree::Punct(punct) => tokens.push(punct.as_char().to_string()),
        }
    }
}

fn is_name(token: &str) -> bool {
    token.starts_with(|c: char| c.is_alphabetic() || c == '_')
}

impl Modules {
    /// The modules of the files of a crate, given by their names below its folder of sources.
    fn new(files: &[(String, String)]) -> Self {
        let mut modules = Self::default();
        let place = |name: &str| -> Module {
            let parts = name.trim_end_matches(".rs").split('/').map(String::from);
            parts.filter(|part| part != "lib" && part != "mod").collect()
        };
        modules.files = files.iter().map(|(name, _)| (place(name), name.clone())).collect();
        for (name, text) in files {
            let mut tokens = Vec::new();
            flatten(text.parse().unwrap_or_else(|error| panic!("{name}: {error}")), &mut tokens);
            modules.read(name, place(name), &tokens);
        }
        modules
    }

    fn read(&mut self, file: &str, module: Module, tokens: &[String]) {
        // Modules in the file, each with the depth of the braces that it ends at.
        let (mut open, mut depth, mut at) = (vec![(module, 0)], 0, 0);
        let token = |at: usize| tokens.get(at).map_or("", String::as_str);
        while at < tokens.len() {
            let module = open.last().map(|(module, _)| module.clone()).unwrap_or_default();
            match token(at) {
                "mod" if token(at + 2) == "{" => {
                    let inner = [module, vec![token(at + 1).to_owned()]].concat();
                    self.files.insert(inner.clone(), file.to_owned());
                    open.push((inner, depth));
                    depth += 1;
                    at += 2;
                }
                "{" => depth += 1,
                "}" => {
                    depth -= 1;
                    if open.len() > 1 && open.last().is_some_and(|&(_, end)| end == depth) {
                        open.pop();
                    }
                }
                // Not the captures of an `impl` (`use<'a>`).
                "use" if token(at + 1) != "<" => {
                    at += 1;
                    read_use(tokens, &mut at, &[], self.uses.entry(module).or_default());
                    continue;
                }
                name if is_name(name) && token(at + 1) == "::" => {
                    let mut path = vec![name.to_owned()];
                    while token(at + 1) == "::" && is_name(token(at + 2)) {
                        path.push(token(at + 2).to_owned());
                        at += 2;
                    }
                    self.paths.push((module, path));
                }
                // What follows is no beginning of a path: `<T as Trait>::name`, `::name`.
                "::" => at += usize::from(is_name(token(at + 1))),
                _ => {}
            }
            at += 1;
        }
    }

    /// A path from the root of the crate; `None` if it leads to another crate, or begins with a type.
    fn absolute(&self, module: &[String], path: &[String]) -> Option<Vec<String>> {
        let rest = |start: &[String], skip: usize| Some([start, &path[skip..]].concat());
        match path[0].as_str() {
            "crate" => rest(&[], 1),
            "self" => rest(module, 1),
            "super" => {
                let up = path.iter().take_while(|part| *part == "super").count();
                rest(&module[..module.len().checked_sub(up)?], up)
            }
            first => {
                let child = [module, &path[..1]].concat();
                if self.files.contains_key(&child) {
                    return rest(&child, 1);
                }
                let named = |one: &&Use| one.name == *first && one.path[0] != *first;
                let one = self.uses.get(module)?.iter().find(named)?;
                let target = self.absolute(module, &one.path)?;
                if self.files.contains_key(&target) { rest(&target, 1) } else { None }
            }
        }
    }

    fn imports(&self) -> Imports {
        let mut imports = Imports::new();
        let of_uses =
            self.uses.iter().flat_map(|(module, uses)| uses.iter().map(move |one| (module, &one.path)));
        for (module, path) in of_uses.chain(self.paths.iter().map(|(module, path)| (module, path))) {
            let Some(absolute) = self.absolute(module, path) else { continue };
            let from = &self.files[module];
            let longest = (0..=absolute.len()).rev().find_map(|end| self.files.get(&absolute[..end]));
            let Some(to) = longest.filter(|to| *to != from) else { continue };
            imports.entry(from.clone()).or_default().entry(to.clone()).or_default().insert(path.join("::"));
        }
        imports
    }
}

/// Reads a tree of names from `tokens[*at]` on, up to what ends it.
fn read_use(tokens: &[String], at: &mut usize, prefix: &[String], uses: &mut Vec<Use>) {
    let mut path = prefix.to_vec();
    let mut is_open = true;
    while is_open {
        match tokens[*at].as_str() {
            "{" => {
                *at += 1;
                while tokens[*at] != "}" {
                    read_use(tokens, at, &path, uses);
                    *at += usize::from(tokens[*at] == ",");
                }
                path.clear();
            }
            "::" => {}
            name => path.push(name.to_owned()),
        }
        *at += 1;
        is_open = !path.is_empty() && (tokens[*at] == "::" || tokens[*at - 1] == "::");
    }
    if path.len() > 1 && path.last().is_some_and(|last| last == "self") {
        path.pop();
    }
    let mut name = path.last().cloned().unwrap_or_default();
    if tokens[*at] == "as" {
        name.clone_from(&tokens[*at + 1]);
        *at += 2;
    }
    uses.extend((!path.is_empty()).then_some(Use { path, name }));
}

/// Whether a file is imported by another, be it by way of others.
fn leads(imports: &Imports, from: &str, to: &str) -> bool {
    let (mut seen, mut next) = (BTreeSet::from([from]), vec![from]);
    while let Some(file) = next.pop() {
        if file == to {
            return true;
        }
        next.extend(
            imports
                .get(file)
                .into_iter()
                .flat_map(BTreeMap::keys)
                .map(String::as_str)
                .filter(|&file| seen.insert(file)),
        );
    }
    false
}

/// Imports that are part of a circle.
fn faults(imports: &Imports) -> Vec<String> {
    let mut faults = Vec::new();
    for (from, imported) in imports {
        for (to, paths) in imported.iter().filter(|(to, _)| leads(imports, to, from)) {
            let paths = paths.iter().map(String::as_str).collect::<Vec<_>>().join(", ");
            faults.push(format!("{from} imports {to}, which leads back to it: {paths}"));
        }
    }
    faults
}

/// Names and texts of the files below a folder.
fn collect(folder: &Path, prefix: &str, files: &mut Vec<(String, String)>) {
    for entry in fs::read_dir(folder).unwrap() {
        let entry = entry.unwrap();
        let name = format!("{prefix}{}", entry.file_name().to_str().unwrap());
        if entry.file_type().unwrap().is_dir() {
            // A crate within another has its own root.
            if !entry.path().join("Cargo.toml").exists() {
                collect(&entry.path(), &format!("{name}/"), files);
            }
        } else if name.ends_with(".rs") && name != "main.rs" {
            files.push((name, fs::read_to_string(entry.path()).unwrap()));
        }
    }
}

#[test]
fn no_file_imports_one_that_imports_it() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut folders = ["src", "src/selection", "src/construction", "src/testing"].map(String::from).to_vec();
    for backend in fs::read_dir(root.join("backends")).unwrap() {
        folders.push(format!("backends/{}/src", backend.unwrap().file_name().to_str().unwrap()));
    }
    let mut all = Imports::new();
    for folder in folders {
        let mut files = Vec::new();
        collect(&root.join(&folder), "", &mut files);
        let below = |name: &String| format!("{folder}/{name}");
        for (file, imported) in Modules::new(&files).imports() {
            let imported = imported.into_iter().map(|(to, paths)| (below(&to), paths)).collect();
            all.insert(below(&file), imported);
        }
    }
    let count: usize = all.values().map(BTreeMap::len).sum();
    assert!(all.len() > 200 && count > 500, "{count} imports by {} files: where are the others?", all.len());
    let faults = faults(&all);
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

/// What each of some small crates imports, and whether that is a circle.
#[test]
fn circles_are_found() {
    let of = |files: &[(&str, &str)]| {
        let owned = |&(name, text): &(&str, &str)| (name.to_owned(), text.to_owned());
        Modules::new(&files.iter().map(owned).collect::<Vec<_>>()).imports()
    };
    let circles: [&[(&str, &str)]; 8] = [
        &[("a.rs", "use crate::b::B; struct A;"), ("b.rs", "use crate::a::A; struct B;")],
        &[("a.rs", "fn f() { crate::b::g() }"), ("b.rs", "fn g() { super::a::f() }")],
        &[
            ("a.rs", "use crate::b::{self as c, d}; fn f() { c::g() }"),
            ("b.rs", "mod d { use super::super::a; }"),
        ],
        // By way of a third.
        &[("a.rs", "use super::b::B;"), ("b.rs", "use super::c::{C, D};"), ("c.rs", "use super::{a::*};")],
        // A parent that passes on what its child has, and a child that takes what the parent has from another.
        &[
            ("lib.rs", "mod a; mod b; pub use a::A; pub use self::b::B;"),
            ("a.rs", "use crate::B;"),
            ("b.rs", ""),
        ],
        &[("a.rs", "mod b; use b::B; struct A;"), ("a/b.rs", "struct B(super::A);")],
        // By a module's name.
        &[("a.rs", "use crate::b; fn f() { b::c::g() }"), ("b.rs", ""), ("b/c.rs", "use crate::a::f;")],
        &[
            ("a.rs", "macro_rules! m { () => { $crate::x::y() } } fn f(b: impl crate::b::B) {}"),
            ("b.rs", "use crate::a;"),
        ],
    ];
    for files in circles {
        let imports = of(files);
        let found = faults(&imports);
        assert!(found.len() >= 2, "{files:?}: {found:?}");
    }
    let others: [&[(&str, &str)]; 5] = [
        &[("a.rs", "use crate::b::B;"), ("b.rs", "struct B; mod tests { use super::*; }")],
        &[
            ("lib.rs", "mod a; mod b; pub use a::A;"),
            ("a.rs", "use crate::b::B;"),
            ("b.rs", "use std::a::A;"),
        ],
        &[("a.rs", "mod b; struct A;"), ("a/b.rs", "use super::A;")],
        // What stands in comments, texts and the paths of other crates.
        &[
            ("a.rs", "use crate::b::B; /// See crate::a.\nstruct A;"),
            ("b.rs", "// use crate::a;\nfn f() { \"crate::a\" } "),
        ],
        &[
            ("a.rs", "use crate::b::B;"),
            ("b.rs", "fn f() -> impl F + use<'_> { other::a::A::new(x::<a::A>()) }"),
        ],
    ];
    for files in others {
        assert_eq!(faults(&of(files)), <[String; 0]>::default(), "{files:?}");
    }
}
