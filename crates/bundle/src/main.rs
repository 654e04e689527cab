//! `viscera-bundle`: makes the page's folder and the package, and serves the folder. `cargo xtask web` runs it.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Context, Result, bail};
use viscera_bundle::server::Server;
use viscera_bundle::sizes::{Sizes, small_copies};
use viscera_bundle::{files, module, package, site};

const HELP: &str = "\
Make static files of the page and its wasm module.

Usage: viscera-bundle build [OPTIONS]
       viscera-bundle serve FOLDER [PORT]

  build              wasm-bindgen, names after content; writes
                     OUT/site (the page) and OUT/npm (the package), and prints what travels
    --wasm FILE      the page's module  [default: target/web/wasm32-unknown-unknown/web/viscera_web.wasm]
    --files FILE     that for people's own files  [default: viscera_web_files.wasm beside the default of --wasm]
    --web FOLDER     page/ and package/ are in it                             [default: crates/web]
    --out FOLDER                                                              [default: target/web]

  serve              serve a folder on 127.0.0.1 until Ctrl-C; port 8080 unless told, 0 is any free one";

const DEFAULT_PORT: u16 = 8080;

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    if arguments.is_empty() || arguments.iter().any(|a| ["-h", "--help", "help"].contains(a)) {
        println!("{HELP}");
        return ExitCode::SUCCESS;
    }
    let result = match arguments.as_slice() {
        ["build", options @ ..] => Build::new(options).and_then(|build| build.run()),
        ["serve", folder] => serve(folder, DEFAULT_PORT),
        ["serve", folder, port] => match port.parse() {
            Ok(port) => serve(folder, port),
            Err(_) => Err(anyhow::anyhow!("`{port}` is no port: a number from 0 to 65535")),
        },
        _ => Err(anyhow::anyhow!("these are no arguments of viscera-bundle; --help lists them")),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("{error:#}");
            ExitCode::FAILURE
        }
    }
}

struct Build {
    wasm: PathBuf,
    files: PathBuf,
    web: PathBuf,
    out: PathBuf,
}

impl Build {
    fn new(options: &[&str]) -> Result<Self> {
        let mut build = Self {
            wasm: "target/web/wasm32-unknown-unknown/web/viscera_web.wasm".into(),
            files: "target/web/wasm32-unknown-unknown/web/viscera_web_files.wasm".into(),
            web: "crates/web".into(),
            out: "target/web".into(),
        };
        for pair in options.chunks(2) {
            let place = match pair[0] {
                "--wasm" => &mut build.wasm,
                "--files" => &mut build.files,
                "--web" => &mut build.web,
                "--out" => &mut build.out,
                other => {
                    bail!("unknown option `{other}`; there are --wasm, --files, --web and --out")
                }
            };
            *place = pair.get(1).with_context(|| format!("{} lacks its path", pair[0]))?.into();
        }
        Ok(build)
    }

    fn run(&self) -> Result<()> {
        let module = module::build_all(&self.wasm, &self.files)?;
        let page = files::read(&self.web.join("page"))?;
        let mut generated = module.clone();
        // For people who write programs, not for browsers.
        generated.retain(|path, _| !module::is_types(path));
        let site = site::build(&page, &generated)?;
        let copies = small_copies(&site.files);
        let sizes = Sizes::new(&site.files, &copies);
        print!("\n{}", sizes.table());
        let place = self.out.join("site");
        let all = site.files.iter().chain(&copies).map(|(path, c)| (path.clone(), c.clone()));
        files::write(&place, &all.collect())?;
        println!("\nBuild {}: {}", site.build, place.display());

        let sources = files::read(&self.web.join("package"))?;
        let package = package::build(&sources, &module, env!("CARGO_PKG_VERSION"))?;
        let place = self.out.join("npm");
        files::write(&place, &package)?;
        println!("Package: {}", place.display());
        // At the end: what is too large can still be looked at.
        sizes.check()
    }
}

fn serve(folder: &str, port: u16) -> Result<()> {
    let server = Server::start(Path::new(folder), port)?;
    println!("{} serves {folder} until Ctrl-C", server.url());
    server.wait();
    Ok(())
}
