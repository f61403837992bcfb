//! A ROS 2 node without ROS, for tests of `armload watch --ros2`: another implementation of DDS, of the messages and
//! of the names than the one that armload uses.
//!
//!     ros2_peer publish TOPIC RATE_HZ reliable|best_effort < rows
//!     ros2_peer subscribe NODE
//!
//! `publish` sends one sensor_msgs/JointState per line of standard input, RATE_HZ lines a second of real time. The
//! first line names the joints; the others have sec, nanosec, then the positions and the efforts. `subscribe` prints
//! one line for every message on NODE/payload, NODE/events and /diagnostics, until standard input ends.

use std::io::{BufRead, Write};
use std::net::{IpAddr, Ipv4Addr};
use std::time::{Duration, Instant};

use futures::StreamExt;
use ros2_client::qos::{Durability, History, WhenFull};
use ros2_client::{Context, MessageTypeName, Name, Node, NodeName, NodeOptions, QosProfile};
use rustdds::DomainParticipantBuilder;
use serde::{Deserialize, Serialize};

#[derive(Debug, Serialize, Deserialize, Clone)]
struct Header {
    sec: i32,
    nanosec: u32,
    frame_id: String,
}

#[derive(Debug, Serialize, Deserialize, Clone)]
struct JointState {
    header: Header,
    name: Vec<String>,
    position: Vec<f64>,
    velocity: Vec<f64>,
    effort: Vec<f64>,
}

#[derive(Debug, Serialize, Deserialize, Clone)]
struct InertiaStamped {
    header: Header,
    m: f64,
    com: [f64; 3],
    inertia: [f64; 6],
}

#[derive(Debug, Serialize, Deserialize, Clone)]
struct DiagnosticStatus {
    level: u8,
    name: String,
    message: String,
    hardware_id: String,
    values: Vec<(String, String)>,
}

#[derive(Debug, Serialize, Deserialize, Clone)]
struct DiagnosticArray {
    header: Header,
    status: Vec<DiagnosticStatus>,
}

fn qos(reliable: bool) -> QosProfile {
    let base = QosProfile::publisher_default()
        .durability(Durability::Volatile)
        .history(History::KeepLast { depth: 1000 });
    if reliable {
        base.reliability_reliable(WhenFull::DEFAULT)
    } else {
        base.reliability_best_effort()
    }
}

/// On the loopback interface only, in the domain of ROS_DOMAIN_ID.
fn context() -> Context {
    let domain = std::env::var("ROS_DOMAIN_ID").map_or(0, |text| text.parse().unwrap());
    let local = DomainParticipantBuilder::new(domain).with_only_networks([IpAddr::V4(Ipv4Addr::LOCALHOST)]);
    Context::from_domain_participant(local.build().unwrap()).unwrap()
}

fn node(context: &Context) -> Node {
    let name = NodeName::new("/", "ros2_peer").unwrap();
    let mut node = context.new_node(name, NodeOptions::new().enable_rosout(false)).unwrap();
    smol::spawn(node.spinner().unwrap().spin()).detach();
    node
}

fn publish(topic: &str, rate_hz: f64, reliable: bool) {
    let context = context();
    let mut node = node(&context);
    let (namespace, base) = topic.rsplit_once('/').unwrap();
    let name = Name::new(if namespace.is_empty() { "/" } else { namespace }, base).unwrap();
    let kind = MessageTypeName::new("sensor_msgs", "JointState");
    let topic = node.create_topic(&name, kind, &qos(reliable)).unwrap();
    let publisher = node.create_publisher::<JointState>(&topic, None).unwrap();
    smol::block_on(publisher.wait_for_subscription(&node));
    // the subscriber knows this publisher a little later than the other way round
    std::thread::sleep(Duration::from_secs(1));

    let mut lines = std::io::stdin().lock().lines();
    let names: Vec<String> = lines.next().unwrap().unwrap().split_whitespace().map(String::from).collect();
    let n = names.len();
    let begun = Instant::now();
    for (index, line) in lines.enumerate() {
        let line = line.unwrap();
        let mut words = line.split_whitespace();
        let sec = words.next().unwrap().parse().unwrap();
        let nanosec = words.next().unwrap().parse().unwrap();
        let numbers: Vec<f64> = words.map(|word| word.parse().unwrap()).collect();
        let due = begun + Duration::from_secs_f64(index as f64 / rate_hz);
        std::thread::sleep(due.saturating_duration_since(Instant::now()));
        publisher
            .publish(JointState {
                header: Header { sec, nanosec, frame_id: String::new() },
                name: names.clone(),
                position: numbers[..n].to_vec(),
                velocity: Vec::new(),
                effort: numbers[n..].to_vec(),
            })
            .unwrap();
    }
    // a reliable writer still has to repeat what was lost
    std::thread::sleep(Duration::from_secs(1));
}

fn subscribe(own: &str) {
    let context = context();
    let mut node = node(&context);
    let quality = qos(true);
    let named = |base: &str| Name::new(own, base).unwrap();
    let payloads = node
        .create_topic(&named("payload"), MessageTypeName::new("geometry_msgs", "InertiaStamped"), &quality)
        .unwrap();
    let events = node
        .create_topic(&named("events"), MessageTypeName::new("std_msgs", "String"), &quality)
        .unwrap();
    let states = node
        .create_topic(
            &Name::new("/", "diagnostics").unwrap(),
            MessageTypeName::new("diagnostic_msgs", "DiagnosticArray"),
            &quality,
        )
        .unwrap();
    let payloads = node.create_subscription::<InertiaStamped>(&payloads, None).unwrap();
    let events = node.create_subscription::<String>(&events, None).unwrap();
    let states = node.create_subscription::<DiagnosticArray>(&states, None).unwrap();
    std::thread::spawn(|| {
        let _ = std::io::copy(&mut std::io::stdin(), &mut std::io::sink());
        std::process::exit(0);
    });
    let print = |text: String| {
        println!("{text}");
        std::io::stdout().flush().unwrap();
    };
    print("ready".into());
    smol::block_on(async {
        futures::join!(
            payloads.async_stream().for_each(|taken| async move {
                if let Ok((p, _)) = taken {
                    let [x, y, z] = p.com;
                    print(format!("payload {}.{:09} {} {:?} {x:?} {y:?} {z:?}", p.header.sec, p.header.nanosec, p.header.frame_id, p.m));
                }
            }),
            events.async_stream().for_each(|taken| async move {
                if let Ok((text, _)) = taken {
                    print(format!("event {text}"));
                }
            }),
            states.async_stream().for_each(|taken| async move {
                if let Ok((array, _)) = taken {
                    for s in array.status {
                        let values: Vec<String> = s.values.iter().map(|(k, v)| format!("{k}={v}")).collect();
                        print(format!("state {} {}: {} [{}]", s.level, s.name, s.message, values.join("; ")));
                    }
                }
            }),
        );
    });
}

fn main() {
    let words: Vec<String> = std::env::args().skip(1).collect();
    match words.iter().map(String::as_str).collect::<Vec<_>>().as_slice() {
        ["publish", topic, rate_hz, reliability] => {
            publish(topic, rate_hz.parse().unwrap(), *reliability == "reliable")
        }
        ["subscribe", own] => subscribe(own),
        _ => {
            eprintln!("usage: ros2_peer publish TOPIC RATE_HZ reliable|best_effort < rows | subscribe NODE");
            std::process::exit(2);
        }
    }
}
